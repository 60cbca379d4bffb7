"""Runs the command by mpirun: some ranks on this machine, or hosts that are network namespaces with addresses of their own."""
import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import time

import command

HOSTS = {"cvdb1": "10.97.0.1", "cvdb2": "10.97.0.2", "cvdb3": "10.97.0.3"}


def binary():
    """The build with the feature `mpi`; `None` where there is none."""
    path = os.environ.get("CLOUDVDB_MPI")
    return pathlib.Path(path).resolve() if path else None


def why_not():
    """Why nothing can be run by mpirun here; `None` where it can."""
    if not binary():
        return "CLOUDVDB_MPI names no cloudvdb with the feature mpi: make test-mpi"
    if not shutil.which("mpirun"):
        return "there is no mpirun here"
    return None


def line(*contexts, flags=()):
    """`contexts` are (ranks, command) of one mpirun."""
    parts = [["-n", str(ranks), *map(str, words)] for ranks, words in contexts]
    joined = parts[0] + [word for part in parts[1:] for word in (":", *part)]
    return ["mpirun", "--allow-run-as-root", "--oversubscribe", *flags, *joined]


def start(words, cwd=None, **kwargs):
    return subprocess.Popen(list(map(str, words)), cwd=cwd, env=command.environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, start_new_session=True, **kwargs)


def run(words, cwd=None, timeout=120, code=0):
    process = start(words, cwd)
    try:
        out, err = process.communicate(timeout=timeout)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert "panicked" not in err, err
    assert code is None or process.returncode == code, (process.returncode, err)
    return process.returncode, out, err


def together(ranks, *words, **kwargs):
    """The command on so many ranks."""
    return run(line((ranks, [binary(), *words])), **kwargs)


def processes(path):
    """The ids of processes that run a program in a folder, in the order of their beginning."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if entry.name.isdigit() and os.readlink(entry / "exe") == str(path):
                found.append(int(entry.name))
    return sorted(found)


def gone(path, within=10.0):
    """Whether no process runs a program any more."""
    until = time.monotonic() + within
    while processes(path):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


@contextlib.contextmanager
def hosts(folder):
    """Hosts with addresses of their own on one bridge; gives mpirun's flags for them. Raises where the machine does not allow it."""
    bridge, made = "cvdbbr", []
    try:
        _ip("link", "add", bridge, "type", "bridge")
        made.append(("link", "del", bridge))
        _ip("addr", "add", "10.97.0.254/24", "dev", bridge)
        _ip("link", "set", bridge, "up")
        for name, address in HOSTS.items():
            _ip("netns", "add", name)
            made.append(("netns", "del", name))
            _ip("link", "add", f"{name}v", "type", "veth", "peer", "name", "eth0", "netns", name)
            _ip("link", "set", f"{name}v", "master", bridge, "up")
            _ip("-n", name, "addr", "add", f"{address}/24", "dev", "eth0")
            _ip("-n", name, "link", "set", "eth0", "up")
            _ip("-n", name, "link", "set", "lo", "up")
        agent = folder / "agent.sh"
        # mpirun's way to another host: its name, then what is to be run there. Each has a name of its own (UTS) too.
        agent.write_text('#!/bin/sh\nhost=$1; shift\nexec ip netns exec "$host" unshare --uts sh -c "hostname $host; $*"\n')
        agent.chmod(0o755)
        yield ["--host", ",".join(HOSTS), "--mca", "plm_rsh_agent", agent, "--mca", "btl", "tcp,self",
               "--mca", "btl_tcp_if_include", "10.97.0.0/24", "--mca", "oob_tcp_if_include", "10.97.0.0/24"]
    finally:
        for words in reversed(made):
            with contextlib.suppress(subprocess.CalledProcessError):
                _ip(*words)
