"""The recorder under load: messages per second without loss.

    python benchmarks/bench_recorder.py [--rate 5000] [--seconds 20]

One process publishes five topics; every message carries its number, and the bag is searched for gaps. Prints
a table and writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import harness
import numpy as np
import rclpy
from rclpy.serialization import serialize_message

from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes import environment, messages, parameters, topics
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.supervisor import Program, Supervisor, node

NAMES = tuple(f"/bench/twist{n}" for n in range(5))


def main() -> None:
    rate, publishes = (5000, "messages a second over all topics"), (False, harness.HIDDEN)
    arguments = harness.options(__doc__, {"--rate": rate, "--seconds": 20.0, "--publish": publishes})
    if arguments.publish:
        publish(arguments.rate, arguments.seconds)
        return
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as scratch:
        rows = measure(Path(scratch), arguments.rate, arguments.seconds)
    lines = harness.heading("Recorder", f", {harness.machine(load)}.")
    harness.store("speed", [*lines, *harness.table("what | measured | goal", rows)])


def publish(rate: int, seconds: float) -> None:
    """Publish numbered messages on all topics; late ticks are caught up."""
    rclpy.init()
    own = rclpy.create_node("bench", enable_rosout=False)
    out = [own.create_publisher(topics.TWIST.message, name, topics.CONTROL_QOS) for name in NAMES]
    while not all(publisher.get_subscription_count() for publisher in out):
        time.sleep(0.05)
    time.sleep(0.5)
    begun = time.monotonic()
    for n in range(int(rate * seconds / len(out))):
        wait = begun + n * len(out) / rate - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        message = serialize_message(messages.twist(time.time_ns(), float(n), "truck"))
        for publisher in out:
            publisher.publish(message)
    print(f"published in {time.monotonic() - begun:.2f} s", flush=True)
    time.sleep(1.0)


def measure(folder: Path, rate: int, seconds: float) -> list[str]:
    """Record the publisher until it ends, then inspect the bag."""
    # The recorder must know the type before a topic appears, so that the first message is not missed.
    domain = 98
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    run = environment.run_folder(folder / "runs", "bench", domain)
    lock = environment.DomainLock(domain)
    parameters.write_file(
        run / "parameters.yaml", {"recorder": {"bag": str(folder / "bag"), "topics": list(NAMES)}}
    )
    argv = (sys.executable, __file__, "--publish", "--rate", str(rate), "--seconds", str(seconds))
    programs = [
        node("recorder", run / "parameters.yaml"),
        Program("publisher", argv, ends_run=True, says_ready=False),
    ]
    code = Supervisor(run, programs, environment.ros_environment(run, domain), lock.descriptor).run()
    lock.release()
    if code:
        sys.exit(code)
    return inspect(folder / "bag", int(rate * seconds / len(NAMES)), (run / "publisher.log").read_text())


def inspect(bag: Path, each: int, said: str) -> list[str]:
    """Number of the published messages in the bag, and the time that they span."""
    numbers: dict[str, list[float]] = {name: [] for name in NAMES}
    ages = []
    with BagSource(bag) as source:
        for topic, at, data in source.messages(set(NAMES)):
            # Header with frame_id 'truck', then linear.x
            numbers[topic].append(float(np.frombuffer(data, "<f8", 1, len(data) - 48)[0]))
            ages.append(
                at - (int.from_bytes(data[4:8], "little") * SECOND + int.from_bytes(data[8:12], "little"))
            )
    missing = sum(each - len(set(found)) for found in numbers.values())
    taken = float(said.partition("published in ")[2].split()[0])
    p50, p99 = np.percentile(ages, [50, 99]) / 1e6
    count = each * len(NAMES)
    return [
        f"published | {count} messages, {count / taken:.0f} a second | 5000 a second",
        f"missing in the bag | {missing} | 0",
        f"time to the recorder, p50 / p99 | {p50:.2f} / {p99:.2f} ms |",
    ]


if __name__ == "__main__":
    main()
