"""One run a domain, a folder a run, and a name for the bag that is free."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys
from pathlib import Path

import pytest
from deeptruck_nodes import environment

from deeptruck_model.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter


@pytest.mark.parametrize("text", ["102", "-1", "x", "1.5"])
def test_domains_outside_the_safe_range_are_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match=r"not a number in 0\.\.101"):
        environment.domain_id()


def test_the_lock_is_exclusive_says_who_and_is_free_after_release(domain: int, tmp_path: Path) -> None:
    lock = environment.DomainLock(domain, tmp_path / "here")
    with pytest.raises(InputError) as caught:
        environment.DomainLock(domain, tmp_path)
    assert str(os.getpid()) in str(caught.value) and str(tmp_path / "here") in str(caught.value)
    lock.release()
    environment.DomainLock(domain, tmp_path).release()


def test_run_folders_of_one_second_do_not_collide(tmp_path: Path) -> None:
    folders = {environment.run_folder(tmp_path, "simulation", 7) for _ in range(3)}
    assert len(folders) == 3 and all(folder.is_dir() for folder in folders)


def test_unwritable_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write logs"):
        environment.run_folder(tmp_path / "file", "simulation", 7)
    with pytest.raises(InputError, match="cannot record"):
        environment.free_bag(tmp_path / "file" / "bag", overwrite=False)


def test_an_existing_bag_is_kept_unless_told_otherwise(tmp_path: Path) -> None:
    with CrashSafeWriter(tmp_path / "bag"):
        pass
    with pytest.raises(InputError, match="--overwrite"):
        environment.free_bag(tmp_path / "bag", overwrite=False)
    environment.free_bag(tmp_path / "bag", overwrite=True)
    assert not (tmp_path / "bag").exists()


def test_what_is_no_bag_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("years")
    with pytest.raises(InputError, match="is no bag"):
        environment.free_bag(tmp_path / "thesis", overwrite=True)
    assert (tmp_path / "thesis" / "chapter1.tex").exists()


def test_an_unfinished_bag_is_repaired_and_the_message_says_so(tmp_path: Path) -> None:
    writer = CrashSafeWriter(tmp_path / "bag")
    writer.flush()
    with pytest.raises(InputError, match=r"was not finished.*choose another name"):
        environment.free_bag(tmp_path / "bag", overwrite=False)
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    writer._stream.close()


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
