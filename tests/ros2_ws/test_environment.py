"""One run a domain, a folder a run, and what its processes find around them."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_nodes import environment


@pytest.mark.parametrize("text", ["102", "-1", "x", "1.5"])
def test_domains_outside_the_safe_range_are_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match=r"not a number in 0\.\.101"):
        environment.domain_id()


def test_the_lock_is_exclusive_says_who_and_is_free_after_release(domain: int) -> None:
    lock = environment.DomainLock(domain)
    with pytest.raises(InputError, match=f"process {os.getpid()}"):
        environment.DomainLock(domain)
    lock.release()
    environment.DomainLock(domain).release()


def test_unwritable_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write logs"):
        environment.run_folder(tmp_path / "file", "simulation")


def test_beside_a_sourced_ros_its_libraries_come_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wheels = f"{sys.prefix}/lib/python3.12/site-packages/ros_rcl.libs"
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{wheels}:/opt/ros/jazzy/lib")
    ours = environment.ros_environment(tmp_path, 7)
    assert wheels in ours["LD_LIBRARY_PATH"]
    spec = importlib.machinery.ModuleSpec(
        "rclpy", None, origin="/opt/ros/jazzy/lib/python3.12/site-packages/rclpy"
    )
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: spec)
    sourced = environment.ros_environment(tmp_path, 7)
    assert sourced["LD_LIBRARY_PATH"] == "/opt/ros/jazzy/lib"
    assert sourced["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"  # the wheels must not add them again


def test_nodes_stay_on_this_machine_and_log_into_the_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_other")
    ours = environment.ros_environment(tmp_path, 7)
    assert (ours["ROS_DOMAIN_ID"], ours["ROS_LOG_DIR"]) == ("7", str(tmp_path))
    assert "RMW_IMPLEMENTATION" not in ours
    assert Path(ours["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text().count("127.0.0.1") >= 2
