"""Scripts of Python that run as copies of the program that tests them, which has their modules already: to load h5py, numpy and
matplotlib anew takes a quarter of a second to a whole one, and most scripts take little beside it."""
import ast
import contextlib
import io
import os
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
import traceback

TREE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
#: what begins the places of modules of tests and of tools
OURS = (os.path.join(TREE, "tests"), os.path.join(TREE, "drivers"))
#: a program that hands its call to a server, with its environment and its three files, and ends as the script does
CALL = """#!{python} -IS
import os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    socket.send_fds(server, [repr(({path!r}, sys.argv[1:], os.getcwd(), dict(os.environ))).encode()], [0, 1, 2])
    server.shutdown(socket.SHUT_WR)
    sys.exit(int(server.recv(16)))
"""
#: what python3 does with `-c STATEMENTS`, or with a script and its arguments
INTERPRETER = """import os, runpy, sys
del sys.argv[0]
if sys.argv[0] == "-c":
    exec(sys.argv[1])
else:
    sys.path[0] = os.path.dirname(os.path.realpath(sys.argv[0]))
    runpy.run_path(sys.argv[0], run_name="__main__")
"""


def script(path, *arguments, directory=".", environment=None):
    """What `python3 PATH ARGUMENTS` does in a directory, as subprocess.run with texts has it; with `environment` beside that of this
    program."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, open(os.devnull, "rb") as nothing:
        status = _copy(path, [str(argument) for argument in arguments], directory, {**os.environ, **(environment or {})},
                       [file.fileno() for file in (nothing, out, err)])
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode())
    return subprocess.CompletedProcess([path, *arguments], status, *texts)


class Server:
    """A copy of this program that runs scripts for other programs, which call them by name, one after the other."""

    def __init__(self, directory):
        self.address = os.path.join(directory, "scripts")
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(self.address)
            server.listen()
            server.settimeout(1)
            caller = os.getpid()
            self.process = os.fork()
            if self.process == 0:
                os.setsid()
                # it ends by itself where the program that made it has been killed
                while os.getppid() == caller:
                    with contextlib.suppress(TimeoutError):
                        _answer(server)
                os._exit(1)

    def program(self, place, path):
        """Make a program that runs a script."""
        with open(place, "w", encoding="utf-8") as file:
            file.write(CALL.format(python=sys.executable, address=self.address, path=path))
        os.chmod(place, 0o755)

    def interpreter(self, place):
        """Make a program that stands for python3, for GRAVIER_PYTHON: programs start it to draw figures."""
        with open(place + ".py", "w", encoding="utf-8") as file:
            file.write(INTERPRETER)
        self.program(place, place + ".py")
        return place

    def stop(self):
        os.killpg(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)


def _answer(server):
    """Run the script of one call."""
    with server.accept()[0] as caller:
        caller.settimeout(None)
        words, files, _, _ = socket.recv_fds(caller, 2**16, 3)
        while more := caller.recv(2**16):
            words += more
        status = _copy(*ast.literal_eval(words.decode()), files)
        for file in files:
            os.close(file)
        caller.sendall(str(status).encode())


def _copy(path, arguments, directory, environment, files):
    """The status with which a copy of this program ends that runs a script, with `files` as its three."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        _run(path, arguments, directory, environment, files)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _run(path, arguments, directory, environment, files):
    """The part of the copy, which does not come back from here."""
    status = 1
    try:
        os.chdir(directory)
        os.environ.clear()
        os.environ.update(environment)
        for number, file in enumerate(files):
            os.dup2(file, number)
        sys.stdin, sys.stdout, sys.stderr = (io.TextIOWrapper(os.fdopen(number, mode), line_buffering=number == 2)
                                             for number, mode in enumerate(("rb", "wb", "wb")))
        sys.argv = [path, *arguments]
        # where the script would look for modules: not where the test does
        named = [place for place in environment.get("PYTHONPATH", "").split(os.pathsep) if place]
        sys.path[:] = [os.path.dirname(os.path.realpath(path)), *named, *(place for place in sys.path if not place.startswith(OURS))]
        runpy.run_path(path, run_name="__main__")
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(status)
