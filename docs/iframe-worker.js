/* Browsers start no worker from a page on disk. Search then runs its worker's script in a hidden frame. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      const frame = document.createElement("iframe")
      frame.hidden = true
      document.body.append(frame)
      const inner = frame.contentWindow
      inner.postMessageToPage = (data) => this.dispatchEvent(new MessageEvent("message", { data }))
      inner.document.open()
      inner.document.write(
        `<script>
          var postMessage = (data) => postMessageToPage(data)
          var importScripts = (...urls) => urls.reduce((before, url) => before.then(() => new Promise((done) => {
            const script = document.createElement("script")
            script.src = url
            script.onload = done
            document.head.append(script)
          })), Promise.resolve())
        <\/script><script src="${url}"><\/script>`
      )
      inner.document.close()
      this.inner = inner
      this.ready = new Promise((done) => frame.addEventListener("load", done))
    }

    postMessage(data) {
      this.ready.then(() => this.inner.dispatchEvent(new MessageEvent("message", { data })))
    }
  }
}
