# SPDX-License-Identifier: Apache-2.0
"""A release: wheel and sdist are built, and the wheel works alone, without ROS."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

import shipdrag_ros

pytest.importorskip('build')

ROOT = Path(__file__).resolve().parents[1]
PARTS = (
    *('package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'MANIFEST.in'),
    *('LICENSE', 'README.md', 'CHANGELOG.md'),
)
FOLDERS = ('resource', 'shipdrag_ros', 'launch', 'config')
LIMIT_S = 200
SHIPDRAG = '@shipdrag'
WITHOUT_ROS = """
import sys

class WithoutRos:
    def find_spec(self, name, path=None, target=None):
        top = name.partition('.')[0]
        if top == 'rclpy' or top.endswith(('_msgs', '_srvs', '_interfaces')):
            raise ModuleNotFoundError(f'No module named {top!r}', name=top)

sys.meta_path.insert(0, WithoutRos())
"""


@pytest.fixture(scope='module')
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a copy of the tree; return the folder with the sdist, and the wheel made from it."""
    source = tmp_path_factory.mktemp('source')
    for name in PARTS:
        shutil.copy(ROOT / name, source)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns('__pycache__'))
    line = [sys.executable, '-m', 'build', '--no-isolation', str(source)]
    environment = {key: text for key, text in os.environ.items() if key != 'PYTHONPATH'}
    done = subprocess.run(
        line, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return source / 'dist'


@pytest.fixture(scope='module')
def alone(built: Path, tmp_path_factory) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Install the wheel by itself; return what runs Python with it, where no ROS can be had."""
    target = tmp_path_factory.mktemp('installed')
    (wheel,) = built.glob('*.whl')
    line = [sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps', '--no-index']
    subprocess.run(
        [*line, '--disable-pip-version-check', '--target', str(target), str(wheel)],
        timeout=LIMIT_S,
        check=True,
    )
    (target / 'sitecustomize.py').write_text(WITHOUT_ROS)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        line = [
            sys.executable,
            *(word.replace(SHIPDRAG, f'{target}/bin/shipdrag') for word in words),
        ]
        return subprocess.run(
            line,
            cwd=target,
            env=os.environ | {'PYTHONPATH': str(target)},
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )

    return run


def test_the_wheel_holds_all_of_the_package(built: Path) -> None:
    (wheel,) = built.glob('*.whl')
    assert wheel.name.startswith(f'shipdrag_ros-{shipdrag_ros.__version__}-py3-none-any')
    with zipfile.ZipFile(wheel) as file:
        held = set(file.namelist())
    package = ROOT / 'shipdrag_ros'
    expected = {
        str(path.relative_to(ROOT))
        for path in package.rglob('*')
        if path.is_file() and '__pycache__' not in path.parts
    }
    assert expected - held == set()
    assert 'shipdrag_ros/py.typed' in held
    assert any(name.startswith('shipdrag_ros/live/page/vendor/') for name in held)
    share = f'shipdrag_ros-{shipdrag_ros.__version__}.data/data/share/'
    assert f'{share}ament_index/resource_index/packages/shipdrag_ros' in held
    assert f'{share}shipdrag_ros/package.xml' in held


def test_the_wheel_describes_itself(built: Path) -> None:
    (wheel,) = built.glob('*.whl')
    with zipfile.ZipFile(wheel) as file:
        (name,) = (name for name in file.namelist() if name.endswith('METADATA'))
        about = file.read(name).decode('utf-8')
    assert 'Description-Content-Type: text/markdown' in about
    assert (ROOT / 'README.md').read_text(encoding='utf-8').strip() in about


@pytest.mark.parametrize(
    ('heading', 'tag', 'found'),
    [
        ('## [0.3.0] - 2026-12-01', '', 'tag=v0.3.0\n'),
        ('## [0.3.0] - 2026-12-01', 'v0.3.0', ''),  # tagged already
        ('## [Unreleased]', '', ''),
        ('## [0.2.0] - 2026-10-01', '', ''),  # of another version
    ],
)
def test_a_dated_version_without_a_tag_is_released(heading, tag, found, tmp_path):
    text = (ROOT / '.github' / 'workflows' / 'release.yml').read_text(encoding='utf-8')
    (job,) = yaml.safe_load(text)['jobs'].values()
    (step,) = (step for step in job['steps'] if step.get('id') == 'version')
    (tmp_path / 'shipdrag_ros').mkdir()
    (tmp_path / 'shipdrag_ros' / '__init__.py').write_text("__version__ = '0.3.0'\n")
    (tmp_path / 'CHANGELOG.md').write_text(f'{heading}\n')
    git = ['git', '-C', str(tmp_path), '-c', 'user.name=n', '-c', 'user.email=n@localhost']
    subprocess.run([*git, 'init', '-q'], check=True)
    subprocess.run([*git, 'commit', '-q', '--allow-empty', '-m', 'all'], check=True)
    if tag:
        subprocess.run([*git, 'tag', tag], check=True)
    output = tmp_path / 'output'
    output.touch()
    subprocess.run(
        ['bash', '-e', '-c', step['run']],
        cwd=tmp_path,
        env=os.environ | {'GITHUB_OUTPUT': str(output)},
        check=True,
    )
    assert output.read_text() == found
    # nothing is built or tagged without it
    later = job['steps'][job['steps'].index(step) + 1 :]
    assert all(each['if'] == "steps.version.outputs.tag != ''" for each in later)


def test_no_other_version_is_dated_than_the_one_that_is_tagged_next() -> None:
    """One that was tagged keeps its date; nothing here was."""
    dated = re.findall(
        r'^## \[(.+?)\] - \d{4}-',
        (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8'),
        re.MULTILINE,
    )
    git = ['git', '-C', str(ROOT), 'tag', '--list', 'v*']
    tags = subprocess.run(git, capture_output=True, text=True, check=False).stdout.split()
    assert {f'v{each}' for each in dated} <= {*tags, f'v{shipdrag_ros.__version__}'}


def test_a_change_is_one_line_under_the_user_who_notices_it() -> None:
    text = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8').partition('\n## [0.2.0]')[0]
    _, *lines = text.partition('\n## [')[2].splitlines()
    users = 'Aboard|Office|At the desk|Library and formats|ROS, installation and packaging'
    heading = re.compile(rf'### ({users})( \(.+\))?')
    entry = re.compile(r'- (Added|Changed|Fixed|Removed): .{1,160}\.')
    first = next(at for at, line in enumerate(lines) if heading.fullmatch(line))
    rest = [line for line in lines[first:] if line and not heading.fullmatch(line)]
    assert [line for line in rest if not entry.fullmatch(line)] == []


def test_checksums_are_of_all_that_is_released(tmp_path: Path) -> None:
    text = (ROOT / '.github' / 'workflows' / 'release.yml').read_text(encoding='utf-8')
    (job,) = yaml.safe_load(text)['jobs'].values()
    (step,) = (step for step in job['steps'] if step.get('id') == 'checksums')
    dist = tmp_path / 'dist'
    dist.mkdir()
    for name in ('a.whl', 'a b.tar.gz', '-.json'):
        (dist / name).write_text(name)
    subprocess.run(['bash', '-e', '-c', step['run']], cwd=tmp_path, check=True)
    check = ['sha256sum', '-c', 'SHA256SUMS']
    said = subprocess.run(check, cwd=dist, check=True, capture_output=True, text=True).stdout
    assert sorted(said.splitlines()) == ['-.json: OK', 'a b.tar.gz: OK', 'a.whl: OK']
    (dist / 'a.whl').write_text('another')
    assert subprocess.run(check, cwd=dist, check=False, capture_output=True).returncode == 1


def test_the_sdist_holds_what_colcon_needs(built: Path) -> None:
    (sdist,) = built.glob('*.tar.gz')
    with tarfile.open(sdist) as file:
        held = {name.partition('/')[2] for name in file.getnames()}
    wanted = {'package.xml', 'setup.py', 'setup.cfg', 'resource/shipdrag_ros', 'LICENSE'}
    wanted |= {'CHANGELOG.md', 'README.md', 'config/vitus_bering.yaml'}
    wanted |= {f'launch/{path.name}' for path in (ROOT / 'launch').glob('*.launch.py')}
    assert wanted - held == set()


def test_all_but_the_node_runs_without_ros(alone, built):
    where = alone('-c', 'import shipdrag_ros; print(shipdrag_ros.__file__)')
    assert not where.stdout.startswith(str(ROOT))
    ros = alone('-c', 'import rclpy')
    assert 'ModuleNotFoundError' in ros.stderr
    told = alone(SHIPDRAG, '--help')
    assert told.returncode == 0, told.stderr
    assert 'diagnose' in told.stdout
    ship, bag, out = ROOT / 'config' / 'vitus_bering.yaml', built / 'run.mcap', built / 'run.json'
    made = alone(SHIPDRAG, 'simulate', '--ship', str(ship), '-o', str(bag), '--lead-in', '400')
    assert made.returncode == 0, made.stderr
    found = alone(SHIPDRAG, 'replay', str(bag), f'--json={out}')
    assert found.returncode == 0, found.stderr
    assert 'knots' in found.stdout
    (coastdown,) = json.loads(out.read_text())['coastdowns']
    assert len(coastdown['speed_m_s']) > 10
    node = alone(SHIPDRAG, 'node', '--ship', str(ship), '--out', str(built))
    assert node.returncode == 1
    assert node.stderr.startswith('ERROR: ')
    assert 'Traceback' not in node.stderr


def test_the_citation_is_of_this_version() -> None:
    cited = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert cited['version'] == shipdrag_ros.__version__
    assert cited['license'] == 'Apache-2.0'
    assert {'cff-version', 'message', 'title', 'authors', 'type'} <= set(cited)


@pytest.mark.parametrize('name', ['bug', 'wrong_estimate', 'question'])
def test_the_issue_forms_are_such(name: str) -> None:
    path = ROOT / '.github' / 'ISSUE_TEMPLATE' / f'{name}.yml'
    form = yaml.safe_load(path.read_text(encoding='utf-8'))
    assert {'name', 'description', 'body'} <= set(form)
    asked = [part for part in form['body'] if part['type'] != 'markdown']
    assert asked
    assert len({part['id'] for part in asked}) == len(asked)
    if name != 'question':
        assert 'shipdrag doctor' in path.read_text(encoding='utf-8')
