"""A worker process, which runs rollouts until its parent ends.

It does not import base.py, which would cost every worker start-up time.
"""

import sys
import traceback
from typing import Any

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.errors import UsageError

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as Connection
else:
    from multiprocessing.connection import Connection


Reply = Rollout | UsageError | str
"""What a worker sends back: the rollout, the error of a request that cannot be carried out, or the
traceback of another error."""


def serve(descriptor: int) -> None:
    """Call `simulate` with the arguments that come in, until the other end closes."""
    with Connection(descriptor) as connection:
        while True:
            try:
                job = connection.recv()
            except (EOFError, ConnectionResetError):  # closed, or killed with a reply unread
                return
            try:
                connection.send(run_job(job))
            except (BrokenPipeError, ConnectionResetError):  # the parent has been killed
                return


def run_job(job: dict[str, Any]) -> Reply:
    """Call `simulate` with these arguments."""
    try:
        return simulate(**job)
    except UsageError as error:
        return error
    except Exception:  # noqa: BLE001 - the parent raises it
        return traceback.format_exc()
