# SPDX-License-Identifier: Apache-2.0
"""Package description for pip and for colcon (ament_python)."""

from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'shipdrag_ros'

ROS = [  # the edge: a node on a machine without ROS from apt
    'ros-jazzy-rclpy',
    'ros-jazzy-rmw-fastrtps-cpp',  # rclpy alone brings no middleware
    'ros-jazzy-common-interfaces',
]
REPORT = [  # pages and pictures: `--report`, `replay --out`, `demo`, `.plot()`
    'matplotlib',
    'Jinja2',  # with escaping
]
LOGS = [  # formats of log files beyond NMEA 0183, tables and bags
    'nmea2000',  # NMEA 2000: fast packets and fields
    'pymavlink',  # ArduPilot
    'pyulog',  # PX4
]
WATCH = [  # the page on the bridge
    *REPORT,
    'starlette',  # routes, server-sent events
    'uvicorn',  # its server
]
FLEET = [  # fleet, trend, `watch --store`
    *REPORT,
    'dask',  # a graph of bags
    'distributed',  # its workers, here or elsewhere
    'pyarrow',  # the store: Parquet
    'duckdb',  # questions to the store
    'fsspec',  # folders and object stores alike
    's3fs',  # of those, S3
]
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
    version='0.5.0',
    description='Hydrodynamic resistance of a ship from its coastdowns, live and from bags',
    long_description=Path(__file__).with_name('README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    keywords=['ship resistance', 'coastdown', 'hull fouling', 'ROS 2'],
    classifiers=[
        'License :: OSI Approved :: Apache Software License',
        'Programming Language :: Python :: 3',
        'Topic :: Scientific/Engineering',
    ],
    author='shipdrag_ros maintainers',
    license='Apache-2.0',
    python_requires='>=3.11',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={
        PACKAGE: ['py.typed', 'data/*'],
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
    install_requires=[  # what the node needs, and no more
        'numpy',
        'scipy',  # PCHIP tables, ODE integration, statistical tests
        'numba',  # compiled per-sample kernels: validation, onset
        'ruamel.yaml',  # ship, parameter and run files: YAML 1.2
        'mcap',  # bags in and out
        'isal',  # checksums of bags, ten times as fast as zlib's
        'rosbags',  # message definitions and CDR without ROS; rosbag2 directories
        'pynmeagps',  # NMEA 0183 sentences, checksums
        'rich',  # tables and progress bars in the terminal
        'pyserial',  # NMEA 0183 from a serial line
        'shtab',  # completion for bash, zsh and others
    ],
    extras_require={
        'report': REPORT,
        'watch': WATCH,
        'fleet': FLEET,
        'logs': LOGS,
        'ros': ROS,
        'docs': DOCS,
        'dev': DEVELOPMENT,
    },
    entry_points={
        'console_scripts': [
            f'shipdrag = {PACKAGE}.cli:main',
            f'coastdown_node = {PACKAGE}.node.main:main',
        ],
    },
)
