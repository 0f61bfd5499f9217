"""The ROS 2 packages: written whole, well-formed, and their message is the one that is published."""

import re
from xml.etree import ElementTree

import pytest

from sensing.live.outputs.ros import types as ros
from sensing.live.ros_package import main


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("workspace") / "src"
    assert main(["--out", str(folder)]) == 0
    return folder


def test_a_folder_with_something_in_it_is_left_alone(packages, caplog):
    before = sorted(path.name for path in packages.rglob("*"))
    assert main(["--out", str(packages)]) == 2 and "not an empty folder" in caplog.text
    assert sorted(path.name for path in packages.rglob("*")) == before


@pytest.mark.parametrize("name", ["endcap_msgs", "endcap_bringup"])
def test_manifest_and_build_file_agree(packages, name):
    root = ElementTree.parse(packages / name / "package.xml").getroot()
    assert root.get("format") == "3" and root.findtext("name") == name
    assert all(root.find(tag) is not None for tag in ("version", "description", "maintainer", "license"))
    build = (packages / name / "CMakeLists.txt").read_text()
    assert f"project({name})" in build and build.strip().endswith("ament_package()")
    found = set(re.findall(r"find_package\((\w+) REQUIRED\)", build))
    named = {entry.text for tag in ("buildtool_depend", "depend") for entry in root.findall(tag)}
    assert found == named
    for file in re.findall(r'"(msg/\w+\.msg)"', build):
        assert (packages / name / file).is_file()


def test_catkin_pkg_takes_the_manifests(packages):
    package = pytest.importorskip("catkin_pkg.package")
    for path in packages.glob("*/package.xml"):
        warnings = []
        found = package.parse_package(str(path), warnings=warnings)
        assert found.name == path.parent.name and warnings == []


def test_the_message_is_the_one_that_is_published(packages):
    parser = pytest.importorskip("mcap_ros2._vendor.rosidl_adapter.parser")  # ROS's own reader of .msg files
    text = (packages / "endcap_msgs" / "msg" / "EndcapWrench.msg").read_text()
    parsed = parser.parse_message_string("endcap_msgs", "EndcapWrench", text)
    fields = ros.typestore().fielddefs[ros.ENDCAP_WRENCH]
    assert [field.name for field in parsed.fields] == [name for name, _ in fields[1]]
    assert {(constant.name, constant.value) for constant in parsed.constants} == {(n, v) for n, _, v in fields[0]}
    assert str(parsed.fields[2].type) == "float64[36]"


def test_the_launch_file_starts_the_program(packages):
    root = ElementTree.parse(packages / "endcap_bringup" / "launch" / "endcap.launch.xml").getroot()
    arguments = {entry.get("name") for entry in root.findall("arg")}
    (executable,) = root.findall("executable")
    assert root.tag == "launch" and set(re.findall(r"\$\(var (\w+)\)", executable.get("cmd"))) == arguments
    assert executable.get("cmd").split(")")[1].split()[:2] == ["live", "--ros"]
