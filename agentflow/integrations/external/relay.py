"""Runs a program for which the only way out is one socket file: `relay.py PORT FILE WORDS...`.

It is passed as text to a Python that knows no agentflow, so it imports the standard library only.
"""

import signal
import socket
import subprocess
import sys
from contextlib import suppress
from threading import Thread


def pump(source: socket.socket, sink: socket.socket) -> None:
    """Copy what comes from one connection to the other, until it ends."""
    with suppress(OSError):
        while data := source.recv(1 << 16):
            sink.sendall(data)
    with suppress(OSError):
        sink.shutdown(socket.SHUT_WR)


def serve(listening: socket.socket, file: str) -> None:
    """Connect each caller of a port with the socket file."""
    while True:
        caller, _ = listening.accept()
        answering = socket.socket(socket.AF_UNIX)
        answering.connect(file)
        for ends in ((caller, answering), (answering, caller)):
            Thread(target=pump, args=ends, daemon=True).start()


def main(port: str, file: str, *words: str) -> int:
    """Run the program; its exit status, or 128 and the number of the signal that killed it."""
    listening = socket.create_server(("127.0.0.1", int(port)))
    Thread(target=serve, args=(listening, file), daemon=True).start()
    signal.signal(signal.SIGTERM, lambda *_: None)  # the program gets it, too, and ends by itself
    status = subprocess.call(words)
    return status if status >= 0 else 128 - status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
