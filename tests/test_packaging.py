# SPDX-License-Identifier: Apache-2.0
"""The same tree as a pip package and as an ament_python package."""

from __future__ import annotations

import ast
import compileall
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import entry_points
from pathlib import Path

import pytest

import shipdrag_ros
from shipdrag_ros.messages import TOPICS

ROOT = Path(__file__).resolve().parents[1]
COLCON = Path(sys.executable).with_name('colcon')
PARTS = ('package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'LICENSE', 'README.md')
# read in rosdep/python.yaml of ros/rosdistro, commit 000730dc5f91: for any Ubuntu. python3-numba
# is there for Ubuntu up to focal alone, python3-rich and python3-starlette are not
ROSDEP_KEYS = {
    *('python3-jinja2', 'python3-matplotlib', 'python3-numpy', 'python3-ruamel.yaml'),
    *('python3-scipy', 'python3-serial', 'python3-uvicorn', 'python3-pytest'),
}
FOLDERS = ('resource', 'shipdrag_ros', 'launch', 'config')


@pytest.fixture(scope='module')
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package with colcon in a workspace of its own; return the install prefix."""
    if not COLCON.exists():
        pytest.skip('colcon is not installed')
    workspace = tmp_path_factory.mktemp('workspace')
    source = workspace / 'src' / 'shipdrag_ros'
    source.mkdir(parents=True)
    for name in PARTS:
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, source)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns('__pycache__'))
    environment = {**os.environ, 'PATH': f'{COLCON.parent}{os.pathsep}{os.environ["PATH"]}'}
    done = subprocess.run(
        [COLCON, 'build'],
        cwd=workspace,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return workspace / 'install' / 'shipdrag_ros'


def test_ament_index_finds_the_colcon_build(built: Path) -> None:
    index = pytest.importorskip('ament_index_python.packages')
    code = (
        'from ament_index_python.packages import get_package_share_directory as s;'
        'print(s("shipdrag_ros"))'
    )
    found = subprocess.run(
        [sys.executable, '-c', code],
        env={**os.environ, 'AMENT_PREFIX_PATH': str(built)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert index is not None
    assert Path(found.stdout.strip()) == built / 'share' / 'shipdrag_ros'


def test_colcon_build_has_all_that_ros2_run_and_launch_need(built: Path) -> None:
    share = built / 'share' / 'shipdrag_ros'
    assert (share / 'package.xml').exists()
    # the hook that puts the package on AMENT_PREFIX_PATH; a bad maintainer e-mail drops it
    assert (share / 'hook' / 'ament_prefix_path.sh').exists()
    assert sorted(path.name for path in (built / 'lib' / 'shipdrag_ros').iterdir()) == [
        'coastdown_node',
        'shipdrag',
    ]
    for folder in ('launch', 'config'):
        expected = {path.name for path in (ROOT / folder).iterdir() if path.is_file()}
        assert {path.name for path in (share / folder).iterdir()} == expected != set()


def test_launch_files_compile_and_every_input_has_a_remap() -> None:
    assert compileall.compile_dir(ROOT / 'launch', quiet=1, force=True)
    tree = ast.parse((ROOT / 'launch' / 'coastdown.launch.py').read_text())
    (names,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == 'INPUTS'
    )
    assert set(names) == set(TOPICS)
    example = (ROOT / 'launch' / 'onboard.launch.py').read_text()
    given = re.search(r'launch_arguments=(\{.*?\})', example, flags=re.DOTALL)
    assert given is not None
    keys = set(re.findall(r"'(\w+)':", given[1]))
    declared = set(re.findall(r"\('(\w+)', ", ast.unparse(tree)))
    assert keys <= declared | set(names)


def test_package_xml_and_setup_agree() -> None:
    xml = ElementTree.parse(ROOT / 'package.xml').getroot()
    setup = (ROOT / 'setup.py').read_text()
    assert xml.findtext('name') == 'shipdrag_ros'
    assert xml.findtext('license') == 'Apache-2.0'
    assert xml.findtext('version') == shipdrag_ros.__version__
    assert f"version='{shipdrag_ros.__version__}'" in setup
    maintainer = xml.find('maintainer')
    assert maintainer is not None
    email = maintainer.get('email', '')
    assert re.fullmatch(r'[\w.+-]+@[\w-]+(\.[\w-]+)+', email)


def test_no_address_is_made_up() -> None:
    """`example.org` is somebody's; `.invalid` is nobody's and says so."""
    names = ('setup.py', 'package.xml', 'CITATION.cff', 'SECURITY.md', 'CODE_OF_CONDUCT.md')
    for path in (ROOT / name for name in names):
        for host in re.findall(r'[\w.+-]+@([\w-]+(?:\.[\w-]+)+)', path.read_text('utf-8')):
            assert host.endswith('.invalid'), f'{path.name}: {host}'


def test_every_direct_dependency_is_pinned_with_a_hash() -> None:
    setup = (ROOT / 'setup.py').read_text()
    lock = (ROOT / 'requirements.lock').read_text().lower()
    names = re.findall(r"^ {4,8}'([A-Za-z][\w-]*)',", setup, flags=re.MULTILINE)
    assert 'numpy' in names
    assert 'ros-jazzy-rclpy' in names
    for name in names:
        assert re.search(rf'^{re.escape(name.lower())}==\S+', lock, flags=re.MULTILINE), name
    assert lock.count('--hash=sha256:') > 100


def test_every_dependency_is_installed_under_ros_too() -> None:
    setup = (ROOT / 'setup.py').read_text().partition('install_requires=')[2].partition(']')[0]
    xml = (ROOT / 'package.xml').read_text()
    names = re.findall(r"^ {8}'([A-Za-z][\w.-]*)',", setup, flags=re.MULTILINE)
    assert {'numpy', 'mcap', 'numba'} <= set(names)
    keys = set(re.findall(r'<exec_depend>python3-(\S+)</exec_depend>', xml))
    from_pip = set(re.findall(r'[\w.]+', xml.partition('<!-- from pip')[2].partition('-->')[0]))
    for name in names:
        assert name.lower().removeprefix('py') in keys or name in from_pip, name
    (line,) = re.findall(
        r'pip install --break-system-packages (.+)', (ROOT / 'docs/ros.md').read_text()
    )
    by_hand = set(line.split())
    assert set(names) & from_pip == by_hand
    assert by_hand <= set(names)


def test_every_key_of_rosdep_resolves_and_no_package_of_ros_is_forgotten() -> None:
    xml = ElementTree.parse(ROOT / 'package.xml').getroot()
    keys = {item.text for item in xml.iter() if item.tag.endswith('depend')}
    assert {key for key in keys if str(key).startswith('python3-')} <= ROSDEP_KEYS
    lines = ' '.join(path.read_text() for path in (ROOT / 'shipdrag_ros').rglob('*.py'))
    used = set(re.findall(r'(?:from|import) ([a-z]+_(?:msgs|srvs|interfaces)|rclpy)\b', lines))
    assert {'rclpy', 'rcl_interfaces', 'std_srvs'} <= used
    assert used <= keys


def test_console_scripts_are_installed() -> None:
    scripts = {item.name: item for item in entry_points(group='console_scripts')}
    assert callable(scripts['shipdrag'].load())
    pytest.importorskip('rclpy')
    assert callable(scripts['coastdown_node'].load())
