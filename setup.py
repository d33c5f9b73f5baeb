# SPDX-License-Identifier: Apache-2.0
"""Package description for pip and for colcon (ament_python)."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = 'shipdrag_ros'

ROS = [  # the edge: a node on a machine without ROS from apt
    'ros-jazzy-rclpy',
    'ros-jazzy-rmw-fastrtps-cpp',  # rclpy alone brings no middleware
    'ros-jazzy-common-interfaces',
]
FLIGHT = ['pymavlink', 'pyulog']  # logs of ArduPilot and PX4 vessels
DOCS = [
    'mkdocs-material',  # the site, searched without a network
    'mkdocstrings[python]',  # its pages of the Python interface
]
DEVELOPMENT = [
    'pandas',  # frames that a user may bring
    'polars',
    'nbclient',  # runs the notebooks
    'nbformat',
    'ipykernel',
    'build',  # wheel and sdist, as they are released
    'pytest',
    'pytest-timeout',  # a hung node must not hang the suite
    'pytest-xdist',  # the suite in minutes on two cores
    'hypothesis',  # property tests: cut invariance, bad input
    'mypy',
    'PyYAML',  # an independent reader and writer of YAML
    'types-PyYAML',
    'ruff',
    'psutil',  # memory and CPU in the benchmarks
    'playwright',  # drives the browser that opens the pages
    'axe-playwright-python',  # accessibility of the pages
    'httpx',  # an independent client of the page's server
    'moto[server]',  # an object store on this machine
    'mcap-ros2-support',  # an independent reader to check our bags against
    'colcon-core',  # the same tree builds as an ament_python package
    'colcon-ros',
    'colcon-python-setup-py',
    'setuptools',
]

setup(
    name=PACKAGE,
    version='0.2.0',
    description='Hydrodynamic resistance of a ship from its coastdowns, live and from bags',
    author='shipdrag_ros maintainers',
    license='Apache-2.0',
    python_requires='>=3.11',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={
        PACKAGE: ['py.typed', 'data/*'],
        f'{PACKAGE}.diagnosis': ['*.json'],
        f'{PACKAGE}.report': ['*.html'],
        f'{PACKAGE}.live': ['page/*', 'page/vendor/*'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/launch', glob('launch/*.launch.py')),
        (f'share/{PACKAGE}/config', glob('config/*')),
    ],
    zip_safe=False,
    install_requires=[
        'numpy',
        'scipy',  # PCHIP tables, ODE integration, statistical tests
        'numba',  # compiled per-sample kernels: validation, onset
        'ruamel.yaml',  # ship, parameter and run files: YAML 1.2
        'mcap',  # bags in and out
        'isal',  # checksums of bags, ten times as fast as zlib's
        'rosbags',  # message definitions and CDR without ROS; rosbag2 directories
        'pynmeagps',  # NMEA 0183 sentences, checksums
        'rich',  # tables and progress bars in the terminal
        'matplotlib',  # pictures of a report
        'Jinja2',  # the report's page, with escaping
        'starlette',  # the page on the bridge: routes, server-sent events
        'uvicorn',  # its server
        'pyserial',  # NMEA 0183 from a serial line
        'nmea2000',  # NMEA 2000: fast packets and fields
        'shtab',  # completion for bash, zsh and others
        'dask',  # the fleet: a graph of bags
        'distributed',  # its workers, here or elsewhere
        'pyarrow',  # the fleet's store: Parquet
        'duckdb',  # questions to the store
        'fsspec',  # folders and object stores alike
        's3fs',  # of those, S3
    ],
    extras_require={'ros': ROS, 'flight': FLIGHT, 'docs': DOCS, 'dev': DEVELOPMENT},
    entry_points={
        'console_scripts': [
            f'shipdrag = {PACKAGE}.cli:main',
            f'coastdown_node = {PACKAGE}.node.main:main',
        ],
        'shipdrag.papers': [
            f'{name} = {PACKAGE}.studies.{name}:STUDY'
            for name in ('cable', 'sensitivity', 'residual', 'surface')
        ],
    },
)
