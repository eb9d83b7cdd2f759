"""Environment of a run: environment variables, ROS domain, and run folder."""

from __future__ import annotations

import fcntl
import importlib.resources
import importlib.util
import os
import sys
import tempfile
import time
from pathlib import Path

from deeptruck_core.errors import InputError

DOMAIN = "ROS_DOMAIN_ID"
ENDED = "ended.txt"  # in the folder of a run: why it ended
LAST_DOMAIN = 101  # above, the ports of Fast DDS run into Linux's ephemeral ones


def domain_id() -> int:
    """The ROS domain of this run, from ROS_DOMAIN_ID. Raises InputError if the value is not valid."""
    text = os.environ.get(DOMAIN) or "0"
    if not text.isdecimal() or int(text) > LAST_DOMAIN:
        raise InputError(f"{DOMAIN}={text} is not a number in 0..{LAST_DOMAIN}")
    return int(text)


class DomainLock:
    """Allows one run per ROS domain on this machine, because the nodes of two runs would receive each other's
    messages.

    The processes of the run inherit the lock, so that it is held until the last one has ended, however the
    run ends. The file that a killed run leaves behind is unlocked and does not block another run.
    """

    def __init__(self, domain: int) -> None:
        path = Path(tempfile.gettempdir()) / f"deeptruck-domain-{domain}.lock"
        try:
            self._file = path.open("a+")
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"another run is using ROS domain {domain} ({path.read_text() or 'just starting'}); "
                f"end its processes, or set {DOMAIN} to another number"
            ) from None
        except OSError as error:
            raise InputError(f"cannot lock ROS domain {domain} with {path}: {error.strerror}") from None
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()}")
        self._file.flush()

    @property
    def descriptor(self) -> int:
        """File descriptor of the lock, which every process of the run inherits."""
        return self._file.fileno()

    def release(self) -> None:
        self._file.close()


def run_folder(runs: Path, what: str) -> Path:
    """A new folder for the logs and parameters of one run. Raises InputError if it cannot be created."""
    folder = (runs / f"{time.strftime('%Y%m%d-%H%M%S')}-{what}-{os.getpid()}").absolute()
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise InputError(
            f"cannot write logs to {folder}: {error.strerror}; choose another with --runs"
        ) from None
    return folder


def ros_environment(folder: Path, domain: int) -> dict[str, str]:
    """The environment of every process of a run."""
    environment = dict(os.environ)
    profile = importlib.resources.files("deeptruck_nodes").joinpath("fastdds.xml")
    environment |= {
        DOMAIN: str(domain),
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
        # The profile alone decides: LOCALHOST would add shared memory and listen on every interface.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "ROS_LOG_DIR": str(folder),
        "OMP_NUM_THREADS": "1",
        "PYTHONUNBUFFERED": "1",
    }
    for name in ("RMW_IMPLEMENTATION", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS"):
        environment.pop(name, None)
    if _ros_is_sourced():  # then its libraries, not the wheels'
        kept = [
            p
            for p in environment.get("LD_LIBRARY_PATH", "").split(os.pathsep)
            if not p.startswith(sys.prefix)
        ]
        environment["LD_LIBRARY_PATH"] = os.pathsep.join(kept)
        environment["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
    return environment


def _ros_is_sourced() -> bool:
    """Whether rclpy comes from a ROS installation on PYTHONPATH rather than from this Python's wheels."""
    spec = importlib.util.find_spec("rclpy")
    return spec is not None and not (spec.origin or "").startswith(sys.prefix)
