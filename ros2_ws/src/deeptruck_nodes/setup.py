"""For `colcon build`; without colcon the project's own pyproject.toml installs the same package."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import setup

PACKAGE = "deeptruck_nodes"
NODES = (
    "truck_sim",
    "leader",
    "controller",
    "can_bridge",
    "recorder",
    "replay",
    "live_page",
)

setup(
    name=PACKAGE,
    version=ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version"),
    packages=[PACKAGE],
    package_data={PACKAGE: ["*.yaml", "*.xml", "*.html", "*.css", "*.js"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={"console_scripts": [f"{node} = {PACKAGE}.{node}:main" for node in NODES]},
)
