"""The server of designs at a bench: `python -m server.app`, or `uvicorn server.app:app`."""

import uvicorn

from agentflow.integrations.openenv import make_app

app = make_app(sessions=100, rollouts=24)


def main() -> None:
    """Serve until Ctrl-C."""
    uvicorn.run(app, host="0.0.0.0", port=8000)


if __name__ == "__main__":
    main()
