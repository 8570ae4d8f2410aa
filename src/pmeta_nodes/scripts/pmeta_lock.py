"""Who writes a run folder: the lock that its writer holds, as the core's RunLock takes it."""

import contextlib
import errno
import fcntl
import json
import os
import socket
import struct

from pmeta_files import PlotError, shown

# where the file system cannot lock, the second file alone counts
LOCK, WITHOUT_LOCKS = "lock", "lock.process"
# locks of the open file, not of the process; Python 3.8 has no names for these numbers of Linux
OFD_GETLK, OFD_SETLK = 36, 37
FLOCK = "hhqqi4x"  # struct flock: kind, from where, start, length (0: all), process


def holder_of(folder):
    """Who writes that run folder now, e.g. "process 4711 on host robot2"; "" if nobody does."""
    with _opened(os.path.join(folder, LOCK), os.O_RDONLY) as file:
        if file is not None and _is_locked(file):
            return _text(_read(file))
    return _named_holder(folder)


@contextlib.contextmanager
def held(folder):
    """Within it nobody else can write the run folder; throws PlotError if somebody does."""
    path = os.path.join(folder, LOCK)
    with _opened(path, os.O_RDWR | os.O_CREAT) as file:
        try:
            fcntl.fcntl(file, OFD_SETLK, _whole_file())
            holder = _named_holder(folder)
            if not os.path.exists(path) or not os.path.samestat(os.fstat(file), os.stat(path)):
                holder = "another process"  # whoever lets go of a folder removes the file
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EACCES):
                holder = _text(_read(file))
            elif error.errno in (errno.ENOLCK, errno.EOPNOTSUPP, errno.EINVAL):
                holder = _named_holder(folder)
            else:
                raise
        if holder:
            raise PlotError("the run %s is being written by %s: wait until that has ended, or stop "
                            "it." % (folder, holder))
        yield


def _named_holder(folder):
    """Whom the file names that counts where the file system cannot lock, if that process lives."""
    with _opened(os.path.join(folder, WITHOUT_LOCKS), os.O_RDONLY) as file:
        if file is None:
            return ""
        holder = _read(file)
        return _text(holder) if _alive(*holder) else ""


@contextlib.contextmanager
def _opened(path, flags):
    """The number of the open file, or None if there is no such file."""
    try:
        file = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except FileNotFoundError:
        yield None
        return
    try:
        yield file
    finally:
        os.close(file)


def _whole_file():
    return struct.pack(FLOCK, fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)


def _is_locked(file):
    try:
        return struct.unpack(FLOCK, fcntl.fcntl(file, OFD_GETLK, _whole_file()))[0] != fcntl.F_UNLCK
    except OSError:
        return False  # the file system cannot lock


def _read(file):
    """(process, when it began, host) as the file says; None for what it does not."""
    try:
        holder = json.loads(os.read(file, 1024).decode("utf-8"))
    except (ValueError, RecursionError):
        holder = None
    holder = holder if isinstance(holder, dict) else {}
    pid, start, host = (holder.get(key) for key in ("pid", "start", "host"))
    return (pid if isinstance(pid, int) and pid > 0 else None,
            start if isinstance(start, int) and start > 0 else None,
            host if isinstance(host, str) and host else None)


def _text(holder):
    pid, _, host = holder
    return "process %d on host %s" % (pid, shown(host)) if pid and host else "another process"


def _alive(pid, start, host):
    """Of a process of another host nobody here can know."""
    if pid is None or host != socket.gethostname():
        return True
    try:
        with open("/proc/%d/stat" % pid) as file:
            # the name of the program, in brackets, may hold blanks and brackets
            return start in (None, int(file.read().rpartition(")")[2].split()[19]))
    except OSError:
        return False
