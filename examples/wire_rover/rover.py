"""A rover on the wire (docs/reference/wire.md): `python rover.py unix:/tmp/rover.sock`, or `tcp://127.0.0.1:7411`."""

import base64
import hashlib
import json
import math
import os
import pathlib
import socketserver
import sys
import threading
import time

SPEED, LOCK = 0.5, threading.RLock()  # metres a second


def clock():
    return int(time.monotonic() * 1000)


class Rover:
    def __init__(self):
        self.x = self.y = self.wheels = 0.0
        self.boot = self.last = int(time.time()) << 20  # above all that an earlier life has numbered
        self.kept, self.done, self.running, self.files, self.run, self.line = [], {}, {}, {}, None, None
        self.say("update", values=self.state())

    def state(self):
        return {"pose x": self.x, "pose y": self.y, "wheel-speed": self.wheels, "energy-used": clock() / 100}

    def begin(self, key, action, given):
        numbers = [given.get(name, 0.0) for name in ("duration_s", "x", "y")]
        sound = all(type(n) in (int, float) and math.isfinite(n) for n in numbers)
        if action not in ("wait", "navigate", "image", "safemode") or not sound:
            return f"unknown action {action}, or a parameter is not a number"
        if action == "image":
            path, data = f"products/{clock()}.pgm", f"P2 2 1 255 {int(self.x)} {int(self.y)}\n".encode()
            self.files[path], digest = data, hashlib.sha256(data).hexdigest()
            self.say("product", command=list(key), kind="image", path=path, sha256=digest, label={})
        self.running[key] = (action, clock() + 1000 * numbers[0], numbers[1:])
        return ""

    def step(self, elapsed_s):
        for key, (action, end, goal) in list(self.running.items()):
            if action == "navigate":
                dx, dy = goal[0] - self.x, goal[1] - self.y
                share = min(1.0, SPEED * elapsed_s / max(math.hypot(dx, dy), 1e-9))
                self.x, self.y, self.wheels = self.x + dx * share, self.y + dy * share, SPEED
                end = math.inf if share < 1.0 else 0
            if clock() >= end:
                self.over("result", key, success=True, reason="", values={})

    def over(self, kind, key, **members):
        self.running.pop(key, None)
        self.wheels = SPEED * any(action == "navigate" for action, *_ in self.running.values())
        self.done[key] = self.say(kind, command=list(key), updates=self.state(), **members)

    def say(self, what, /, **members):
        self.last += 1
        self.kept.append({"e": what, "t": clock(), "number": self.last, **members})
        self.put(self.line, "event", event=self.kept[-1])
        return self.kept[-1]

    def put(self, line, what, /, **members):
        data = json.dumps({"m": what, **members}).encode()
        try:
            line.sendall(len(data).to_bytes(4, "big") + data)
        except (OSError, AttributeError):
            self.line = None  # whoever was there comes back and says what it has

    def again(self, number):
        for event in [e for e in self.kept if e["number"] > number]:
            self.put(self.line, "event", event=event)

    def hello(self, m, line):
        if m["run"] != self.run and self.running:
            self.put(line, "bye", reason=f"busy with the run {self.run}")
            return
        if m["run"] != self.run and (self.run or not m["have"]):
            self.kept, self.boot = [], self.last
            self.say("update", values=self.state())
        shift = m["have"] - self.boot if m["have"] > self.last else 0  # our clock was set back meanwhile
        self.boot, self.last, self.run, self.line = self.boot + shift, self.last + shift, m["run"], line
        self.kept = [{**e, "number": e["number"] + shift} for e in self.kept]
        stream = {"boot": self.boot, "first": self.last + 1 - len(self.kept), "last": self.last, "rate": 1.0}
        self.put(line, "welcome", protocol="wire/1", rover="wire", run=self.run, t=clock(), **stream)
        self.again(m["have"])

    def hear(self, m, line):
        kind, key, q = m["m"], tuple(m.get("id", ())), {"q": m["q"]} if "q" in m else {}
        at = "running" if key in self.running else "done" if key in self.done else "unknown"
        if kind == "hello":
            self.hello(m, line)
        elif kind == "stop":
            for one in list(self.running):
                self.over("acknowledgement", one)
            self.put(line, "stopped")
        elif line is not self.line:
            return  # only one executive commands
        elif kind in ("send", "abort"):
            if kind == "abort" and at != "done":
                self.over("acknowledgement", key)
            elif at == "unknown" and (why := self.begin(key, m["action"], m.get("parameters", {}))):
                self.over("result", key, success=False, reason=why, values={})
            self.put(line, "command", id=m["id"], state="running" if key in self.running else "done")
        elif kind == "status":
            self.put(line, "status", id=m["id"], state=at, result=self.done.get(key), **q)
        elif kind == "state":
            self.put(line, "state", values=self.state(), t=clock(), **q)
        elif kind == "since":
            self.again(m["number"])
        elif kind == "commit":
            self.kept = [e for e in self.kept if e["number"] > m["number"]]
        elif kind == "beat":
            self.put(line, "beat", echo=m["t"], t=clock(), last=self.last)
        elif kind == "fetch":
            data, about = self.files.get(m["path"], b""), {"path": m["path"], "offset": m["offset"]}
            piece = base64.b64encode(data[m["offset"] : m["offset"] + m["size"]]).decode()
            self.put(line, "chunk", total=len(data) or None, data=piece, **about, **q)


class Talk(socketserver.StreamRequestHandler):
    def handle(self):
        try:
            while 0 < (size := int.from_bytes(self.rfile.read(4), "big")) <= 1 << 20:
                message = json.loads(self.rfile.read(size))
                with LOCK:
                    self.server.rover.hear(message, self.request)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            pass  # whoever talks nonsense has to begin anew


if __name__ == "__main__":
    kind, _, where = sys.argv[1].partition(":")
    if kind == "unix":
        os.umask(0o177)  # the socket is its owner's alone
        pathlib.Path(where).unlink(missing_ok=True)
        server = socketserver.ThreadingUnixStreamServer(where, Talk)
    else:
        server = socketserver.ThreadingTCPServer((where[2:].split(":")[0], int(where.split(":")[1])), Talk)
    server.daemon_threads, server.rover = True, Rover()
    threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    before, turns = clock(), 0
    while not time.sleep(0.005):
        with LOCK:
            before, elapsed, turns = clock(), clock() - before, turns + 1
            server.rover.step(elapsed / 1000)
            if server.rover.running and turns % 100 == 0:
                server.rover.say("update", values=server.rover.state())
