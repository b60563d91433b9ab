// The search runs in a worker, which browsers refuse to pages that are opened from the disk. There an iframe takes its place.
if (location.protocol === "file:") {
  window.frameWorkers = [];
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.waiting = [];
      const number = window.frameWorkers.push(this) - 1;
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.frame.addEventListener("load", () => {
        const waiting = this.waiting;
        this.waiting = null;
        waiting.forEach((data) => this.postMessage(data));
      });
      const source = new URL(url, document.baseURI).href.replaceAll('"', "%22");
      this.frame.srcdoc = `<script>
        self.postMessage = (data) => parent.frameWorkers[${number}].receive(data);
        self.importScripts = (...urls) => Promise.all(urls.map((url) => new Promise((done) => {
          const script = Object.assign(document.createElement("script"), { src: url, onload: done, onerror: done });
          document.body.append(script);
        })));
      <\/script><body><script src="${source}"><\/script></body>`;
      document.head.append(this.frame);
    }
    receive(data) {
      const event = new MessageEvent("message", { data });
      this.dispatchEvent(event);
      this.onmessage?.(event);
    }
    postMessage(data) {
      if (this.waiting) this.waiting.push(data);
      else this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
    }
    terminate() {
      this.frame.remove();
    }
  };
}
