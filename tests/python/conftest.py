import pathlib
import signal
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import command  # noqa: E402

# A shell that runs the tests in the background ignores Ctrl-C for them, and so for what they start, until that listens.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def cloudvdb():
    """The command under test: target/release/cloudvdb, or what CLOUDVDB names."""
    path = command.binary()
    if not path.is_file():
        pytest.fail(f"{path} is missing: build it with `make build`, or name one with CLOUDVDB=...", pytrace=False)
    return command


@pytest.fixture(scope="session")
def scenes():
    return command.SCENES
