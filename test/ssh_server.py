"""An ssh server for tests: takes one key, and does as it is told by whoever has it.

usage: ssh_server.py ADDRESS PORT HOST_KEY AUTHORIZED_KEY
"""
import os
import signal
import socket
import subprocess
import sys
import threading

import paramiko


class Session(paramiko.ServerInterface):
    def __init__(self, authorized):
        self.authorized = authorized

    def get_allowed_auths(self, username):
        return "publickey"

    def check_auth_publickey(self, username, key):
        return paramiko.AUTH_SUCCESSFUL if key == self.authorized else paramiko.AUTH_FAILED

    def check_channel_request(self, kind, chanid):
        return paramiko.OPEN_SUCCEEDED

    def check_channel_exec_request(self, channel, command):
        threading.Thread(target=execute, args=(channel, command.decode()), daemon=True).start()
        return True


def execute(channel, command):
    # as a login gives it: nothing of ROS
    env = {"PATH": "/usr/bin:/bin:/usr/sbin:/sbin", "HOME": os.environ["HOME"],
           "ROS_HOME": os.environ["ROS_HOME"]}
    process = subprocess.Popen(["sh", "-c", command], env=env, stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)

    def feed():
        for data in iter(lambda: channel.recv(1 << 15), b""):
            process.stdin.write(data)
            process.stdin.flush()
        process.stdin.close()

    def drain(pipe, send):
        for data in iter(lambda: os.read(pipe.fileno(), 1 << 15), b""):
            try:
                send(data)
            except OSError:  # it has hung up
                os.killpg(process.pid, signal.SIGHUP)
                return

    threading.Thread(target=feed, daemon=True).start()
    drains = [threading.Thread(target=drain, args=(process.stdout, channel.sendall)),
              threading.Thread(target=drain, args=(process.stderr, channel.sendall_stderr))]
    for thread in drains:
        thread.start()
    for thread in drains:
        thread.join()
    channel.send_exit_status(process.wait() & 0xff)
    channel.close()


def serve(address, port, host_key, authorized_key):
    keys = [paramiko.RSAKey.from_private_key_file(file) for file in (host_key, authorized_key)]
    with socket.create_server((address, int(port))) as server:
        print("listening", flush=True)
        while True:
            transport = paramiko.Transport(server.accept()[0])
            transport.add_server_key(keys[0])
            transport.start_server(server=Session(keys[1]))


if __name__ == "__main__":
    serve(*sys.argv[1:])
