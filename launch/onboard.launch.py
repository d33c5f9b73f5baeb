# SPDX-License-Identifier: Apache-2.0
"""
Example: what a ship starts as one, in a namespace of her own, with her drivers' topics.

    ros2 launch shipdrag_ros onboard.launch.py ship_file:=ship.yaml ship:=vitus_bering

Copy it, and put your drivers where the comment stands. Drivers that are components go into the
container, where messages between them take no network; the node itself is Python and runs
beside it.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import ComposableNodeContainer
from launch_ros.descriptions import ComposableNode
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """
    Describe the drivers, the node with their topics, and the page.
    """
    ship = LaunchConfiguration('ship')
    drivers = ComposableNodeContainer(
        name='drivers',
        namespace=ship,
        package='rclcpp_components',
        executable='component_container_mt',
        composable_node_descriptions=[
            # yours; this one thins a log of 100 Hz to the 10 Hz that are of use
            ComposableNode(
                package='topic_tools',
                plugin='topic_tools::ThrottleNode',
                name='throttle_log',
                namespace=ship,
                parameters=[
                    {
                        'input_topic': 'log/velocity',
                        'output_topic': 'log/velocity_throttled',
                        'throttle_type': 'messages',
                        'msgs_per_sec': 10.0,
                    }
                ],
            ),
        ],
    )
    here = PathJoinSubstitution([FindPackageShare('shipdrag_ros'), 'launch'])
    node = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([here, 'coastdown.launch.py'])),
        launch_arguments={
            'ship_file': LaunchConfiguration('ship_file'),
            'output_directory': LaunchConfiguration('output_directory'),
            'namespace': ship,
            'speed_through_water': 'log/velocity_throttled',
            'position': 'gps/fix',
        }.items(),
    )
    page = ExecuteProcess(cmd=['shipdrag', 'watch'], output='screen')
    return LaunchDescription(
        [
            DeclareLaunchArgument('ship_file', description='path of the ship file (YAML)'),
            DeclareLaunchArgument('output_directory', default_value='records'),
            DeclareLaunchArgument('ship', default_value='ship', description='namespace'),
            drivers,
            node,
            page,
        ]
    )
