"""Notebooks without Jupyter: simulated pages of a widget, and a web page that shows widgets."""

import asyncio
import base64
import json
import queue
import threading
from contextlib import contextmanager
from weakref import WeakKeyDictionary

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket
from waiting import PATIENCE

from .test_window import commands_in

SILENCE = 0.3  # s without a message
_CLIENTS = WeakKeyDictionary()  # of each widget


def hear(widget, content):
    """Deliver a message of a page to a widget."""
    widget.comm.handle_msg(
        {"content": {"data": {"method": "custom", "content": content}}, "buffers": []}
    )


class Client:
    """A simulated page of a widget. It answers only when the test asks for it.

    `name` is the name of the page. `in_cell` tells whether the kernel's main thread receives its
    messages, and so only between cells.
    """

    def __init__(self, widget, name="page", in_cell=False, hello=True):
        self.widget, self.name, self.in_cell = widget, name, in_cell
        self.messages = queue.Queue()
        clients = _CLIENTS.setdefault(widget, [])
        clients[:] = [client for client in clients if client.name != name] + [self]
        widget.send = lambda content, buffers=None: [
            client.take(content, buffers or []) for client in clients
        ]
        if hello:
            self.say("hello")

    def say(self, words):
        def speak():
            hear(self.widget, {"page": self.name, "say": words})

        if self.in_cell:
            speak()  # tests run in the main thread
        else:
            thread = threading.Thread(target=speak)
            thread.start()
            thread.join()

    def take(self, content, buffers):
        if content.get("page", self.name) == self.name:
            self.messages.put((content, buffers))

    def message(self):
        return self.messages.get(timeout=PATIENCE)

    def frame(self):
        """Return number and commands of the next frame, without answering it."""
        content, (data,) = self.message()
        return content["frame"], commands_in(data)

    def commands(self):
        """Return the commands of the next frame, and answer that it is drawn."""
        number, commands = self.frame()
        self.drawn(number)
        return commands

    def drawn(self, number):
        self.say(json.dumps({"type": "done", "number": number}))

    def hears_nothing(self):
        try:
            self.messages.get(timeout=SILENCE)
        except queue.Empty:
            return True
        return False


_PAGE = """<!DOCTYPE html><html><head><link rel="icon" href="data:,">
<style>.output { margin: 4px 0; }</style></head><body><script type="module">
const outputs = document.body;
// A widget's model as anywidget gives it, with a websocket in place of a comm.
window.show = async (id, state) => {
  const heard = new Map(), el = document.createElement("div");
  const socket = new WebSocket(`ws://${location.host}/comm?id=${id}`);
  const bytes = (text) =>
    new DataView(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  const fire = (name, ...args) => [...(heard.get(name) || [])].forEach((call) => call(...args));
  const layout = {comm_live: true};
  const model = {
    get: (name) =>
      name == "thumbnail" ? bytes(state.thumbnail) : name == "layout" ? layout : state[name],
    send: (content) => socket.send(JSON.stringify(content)),
    on: (name, call) => heard.set(name, [...(heard.get(name) || []), call]),
    off: (name, call) => heard.set(name, (heard.get(name) || []).filter((other) => other !== call)),
  };
  el.className = "output";
  outputs.append(el);
  socket.onmessage = ({data}) => {
    const {content, buffers} = JSON.parse(data);
    if (content.trait) {
      state[content.trait] = content.value;
      fire(`change:${content.trait}`);
    } else fire("msg:custom", content, buffers.map(bytes));
  };
  socket.onclose = () => {
    layout.comm_live = false;
    fire("comm_live_update");
  };
  await new Promise((done) => { socket.onopen = done; });
  const {default: widget} = await import("/widget.js");
  const gone = await widget.render({model, el});
  el.remove_output = () => { gone(); el.remove(); };
};
window.started = true;
</script></body></html>"""


class Notebook:
    """A web server with a page that shows widgets.

    Messages of pages are handled in the server's thread, as in a subshell. The page at `/sealed`
    cannot access its frames, like a notebook that isolates its outputs. `sizes` are the bytes of
    the buffers of all messages to pages. `lose` is the number of subsequent frames that do not
    arrive.
    """

    def __init__(self):
        self.widgets = {}
        self.sizes = []
        self.lose = 0
        self.sockets = {}
        self._said = None
        self._newest = None
        self._loop = asyncio.new_event_loop()
        self._listening = tornado.netutil.bind_sockets(0, "127.0.0.1")
        self.url = f"http://127.0.0.1:{self._listening[0].getsockname()[1]}/"
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        asyncio.set_event_loop(self._loop)
        own = {"notebook": self}
        pages = [
            (r"/", _Page, {}),
            (r"/sealed", _Page, {"policy": "sandbox allow-scripts"}),
            (r"/comm", _Comm, own),
        ]
        pages += [(r"/widget.js", _Code, own)]
        server = tornado.httpserver.HTTPServer(
            tornado.web.Application(pages, websocket_max_message_size=64 << 20)
        )
        server.add_sockets(self._listening)
        self._loop.run_forever()
        server.stop()

    def show(self, page, widget):
        """Put an output below the others; return its frame."""
        self.widgets[widget.model_id] = widget
        widget.send = lambda content, buffers=None: self._send(
            widget.model_id, content, buffers or []
        )
        over = {"trait": "is_live", "value": False}
        widget.observe(lambda _: self._send(widget.model_id, over, []), names="is_live")
        state = {name: getattr(widget, name) for name in ("version", "name", "height", "is_live")}
        thumbnail = base64.b64encode(widget.thumbnail).decode()
        page.evaluate(
            "([id, state]) => show(id, state)", [widget.model_id, {**state, "thumbnail": thumbnail}]
        )
        return page.locator(".output").last.locator("iframe").element_handle().content_frame()

    def _send(self, name, content, buffers):
        self.sizes += map(len, buffers)
        if "frame" in content:
            self._newest = name, content, buffers
            if self.lose:
                self.lose -= 1
                return
        text = json.dumps(
            {"content": content, "buffers": [base64.b64encode(data).decode() for data in buffers]}
        )
        self._loop.call_soon_threadsafe(
            lambda: [socket.write_message(text) for socket in self.sockets.get(name, [])]
        )

    def send_again(self):
        """Send the newest frame once more."""
        assert self._newest is not None
        self._send(*self._newest)

    def hear(self, widget, content):
        """Deliver a message of a page, now or later."""
        said = self._said
        if said is None:
            hear(widget, content)
        else:
            said.append((widget, content))

    @contextmanager
    def deaf(self):
        """Delay all messages of pages, like a kernel that runs a cell; deliver them afterwards."""
        said = self._said = []
        try:
            yield said
        finally:
            self._said = None
        self._loop.call_soon_threadsafe(lambda: [hear(*each) for each in said])

    def end(self):
        """End the connections, like a kernel that has stopped."""
        self._loop.call_soon_threadsafe(
            lambda: [one.close() for some in self.sockets.values() for one in some]
        )

    def close(self):
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(PATIENCE)


class _Page(tornado.web.RequestHandler):
    def initialize(self, policy=""):
        self.policy = policy

    def get(self):
        self.set_header("Content-Security-Policy", self.policy)
        self.finish(_PAGE)


class _Code(tornado.web.RequestHandler):
    def initialize(self, notebook):
        self.notebook = notebook

    def get(self):
        """The widget's own, which is the same for all; the page asks for it when the first one is
        shown.
        """
        self.set_header("Content-Type", "text/javascript")
        self.set_header("Access-Control-Allow-Origin", "*")  # a sealed page is of no origin
        self.finish(next(iter(self.notebook.widgets.values())).get_state()["_esm"])


class _Comm(tornado.websocket.WebSocketHandler):
    def initialize(self, notebook):
        self.notebook = notebook

    def check_origin(self, origin):
        return True

    def open(self, *_, **__):
        self.name = self.get_query_argument("id")
        self.notebook.sockets.setdefault(self.name, []).append(self)

    def on_message(self, message):
        self.notebook.hear(self.notebook.widgets[self.name], json.loads(message))

    def on_close(self):
        self.notebook.sockets[self.name].remove(self)
