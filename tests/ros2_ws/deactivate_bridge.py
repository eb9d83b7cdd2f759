"""Run by test_vehicle: what `ros2 lifecycle set /can_bridge deactivate` does."""

import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

rclpy.init()
node = rclpy.create_node("person")
change = node.create_client(ChangeState, "/can_bridge/change_state")
state = node.create_client(GetState, "/can_bridge/get_state")
assert change.wait_for_service(10.0) and state.wait_for_service(10.0)
request = ChangeState.Request()
request.transition.id = Transition.TRANSITION_DEACTIVATE
done = change.call_async(request)
rclpy.spin_until_future_complete(node, done, timeout_sec=10.0)
assert done.result() is not None and done.result().success
now = state.call_async(GetState.Request())
rclpy.spin_until_future_complete(node, now, timeout_sec=10.0)
assert now.result().current_state.id == State.PRIMARY_STATE_INACTIVE
