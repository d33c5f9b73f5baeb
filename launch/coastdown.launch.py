# SPDX-License-Identifier: Apache-2.0
"""
Start the onboard node.

    ros2 launch shipdrag_ros coastdown.launch.py ship_file:=ship.yaml output_directory:=bags

The topics of drivers are named by arguments, `position:=/fix` for instance. Each sets a
remap of the node; without it the input keeps its name. `onboard.launch.py` is an example that
starts the drivers of a ship, the node and the page together.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = (
    ('ship_file', None, 'path of the ship file (YAML)'),
    ('output_directory', '.', 'where recordings are written'),
    (
        'params_file',
        PathJoinSubstitution([FindPackageShare('shipdrag_ros'), 'config', 'parameters.yaml']),
        'parameters of the node; the arguments here override it',
    ),
    ('use_sim_time', 'false', 'take the time from /clock'),
    ('autostart', 'true', 'configure and activate without being asked to'),
    ('namespace', '', 'namespace of the node and of its inputs'),
)
INPUTS = (
    'speed_through_water',
    'speed_over_ground',
    'position',
    'heading',
    'shaft',
    'rudder',
    'wind_apparent',
    'depth',
    'speed_through_water_2',
    'speed_through_water_3',
    'speed_over_ground_2',
    'speed_over_ground_3',
    'position_2',
    'position_3',
)


def generate_launch_description():
    """
    Describe the one node and its arguments.
    """
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    declared += [
        DeclareLaunchArgument(name, default_value=name, description=f'topic of the input {name}')
        for name in INPUTS
    ]
    node = LifecycleNode(
        package='shipdrag_ros',
        executable='coastdown_node',
        name='coastdown_node',
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        remappings=[(name, LaunchConfiguration(name)) for name in INPUTS],
        parameters=[
            LaunchConfiguration('params_file'),
            {
                'ship_file': ParameterValue(LaunchConfiguration('ship_file'), value_type=str),
                'output_directory': ParameterValue(
                    LaunchConfiguration('output_directory'), value_type=str
                ),
                'autostart': ParameterValue(LaunchConfiguration('autostart'), value_type=bool),
                'use_sim_time': ParameterValue(
                    LaunchConfiguration('use_sim_time'), value_type=bool
                ),
            },
        ],
    )
    return LaunchDescription([*declared, node])
