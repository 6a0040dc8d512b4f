"""A worker process, which runs rollouts until its parent ends.

It does not import pool.py, which would cost every worker start-up time.
"""

from __future__ import annotations

import sys
import traceback

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.errors import UsageError

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as Connection
else:
    from multiprocessing.connection import Connection


def serve(descriptor: int) -> None:
    """Call `simulate` with the arguments that come in, until the other end closes."""
    with Connection(descriptor) as connection:
        while True:
            try:
                job = connection.recv()
            except (EOFError, ConnectionResetError):  # closed, or killed with a reply unread
                return
            try:
                reply: Rollout | UsageError | str = simulate(**job)
            except UsageError as error:
                reply = error
            except Exception:  # noqa: BLE001 - the parent raises it
                reply = traceback.format_exc()
            try:
                connection.send(reply)
            except (BrokenPipeError, ConnectionResetError):  # the parent has been killed
                return
