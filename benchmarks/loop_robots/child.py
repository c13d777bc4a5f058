"""First answer of one robot in a fresh process, by parts; prints JSON.

python -m benchmarks.loop_robots.child FOLDER ID
"""

import json
import sys
import time

CLOCK = time.process_time


def main(folder: str, robot_id: str) -> dict:
    """CPU times [s] of reading, of the assembly from the neutral pose, and of the first accelerations."""
    import gauss
    from benchmarks.loop_robots.robots import robots

    robot = next(one for one in robots(folder) if one.given["id"] == robot_id)
    gauss.load("pendulum")
    begin = CLOCK()
    scene = robot.scene()
    read = CLOCK()
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    assembled = CLOCK()
    system.accelerations(state)
    return {"read": read - begin, "assembled": assembled - read, "answered": CLOCK() - assembled}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
