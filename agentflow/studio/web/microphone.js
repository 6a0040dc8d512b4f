// The microphone of a session: off until its button is pressed; sound goes to the studio on this computer only.

import { el } from "../../report/web/dom.js";

const PIECE = 5000; // milliseconds of sound that are sent at a time

export class Microphone {
  /** @param hear receives {data, first}: sound in base64, and whether it begins a recording
   *  @param say receives words for the person */
  constructor(hear, say) {
    this.hear = hear;
    this.say = say;
    this.element = el("button", { type: "button", class: "microphone", "aria-pressed": "false", click: () => (this.recording ? this.stop() : this.start()) }, "Record voice");
  }

  async start() {
    try {
      this.stream = await navigator.mediaDevices.getUserMedia({ audio: true });
    } catch (error) {
      return this.say(`The microphone cannot be used: ${error.message}`);
    }
    let first = true;
    this.sending = Promise.resolve();
    this.recording = new MediaRecorder(this.stream, { mimeType: "audio/webm" });
    this.recording.ondataavailable = ({ data }) => {
      this.sending = this.sending.then(async () => {
        if (!data.size) return;
        await this.hear({ data: await inBase64(data), first });
        first = false;
      }).catch((error) => this.say(error.message));
    };
    this.recording.start(PIECE);
    return this.show(true);
  }

  /** Switch it off; resolves when all sound is sent. */
  async stop() {
    if (!this.recording) return;
    const ended = new Promise((done) => this.recording.addEventListener("stop", done));
    this.recording.stop();
    this.stream.getTracks().forEach((track) => track.stop());
    this.recording = null;
    this.show(false);
    await ended;
    await this.sending;
  }

  show(on) {
    this.element.setAttribute("aria-pressed", on);
    this.element.textContent = on ? "Recording voice" : "Record voice";
  }
}

function inBase64(blob) {
  return new Promise((done) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result.slice(reader.result.indexOf(",") + 1));
    reader.readAsDataURL(blob);
  });
}
