"""ROS 2 without ROS: its messages, its two transports, and a robot as one of its nodes.

`message_table` holds the types, `codec` makes their bytes; `dds` and `zenoh_session` carry them to other nodes, each
behind the `RosTransport` of `transport`. `robot_messages` says what of a robot becomes which message, `robot_node`
when; `frames` where its parts are, `urdf` how RViz draws them, `thesis_topics` what the eight-code world of the thesis
calls them; `bags` are recordings of all that. Nothing of ROS is installed, and nothing is fetched at run time.
"""
