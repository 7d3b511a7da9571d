// Packed data and frames of commands, which every page and the notebook's widget must read.

import {TOO_OLD} from "./messages.js";

export const canUnpack = () => "DecompressionStream" in globalThis;

// Unpack gzipped bytes into an ArrayBuffer. packed: a Uint8Array, or its base64 text.
export async function unpack(packed) {
  if (!canUnpack()) throw new Error(TOO_OLD);
  const data = typeof packed === "string"
    ? Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0))
    : packed;
  const stream = new Blob([data]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

export const unpackText = async (packed) => new TextDecoder().decode(await unpack(packed));

// The commands of a frame (an ArrayBuffer), each as a Uint8Array. In the frame, each command is
// preceded by its length in bytes, as a little-endian uint32.
export function splitFrame(frame) {
  const view = new DataView(frame), commands = [];
  for (let at = 0; at < frame.byteLength;) {
    const begin = at + 4, length = view.getUint32(at, true);
    commands.push(new Uint8Array(frame, begin, length));
    at = begin + length;
  }
  return commands;
}

// The frame of these commands, as an ArrayBuffer.
export function joinFrame(commands) {
  const frame = new Uint8Array(commands.reduce((sum, {length}) => sum + 4 + length, 0));
  const view = new DataView(frame.buffer);
  let at = 0;
  for (const command of commands) {
    view.setUint32(at, command.length, true);
    frame.set(command, at + 4);
    at += 4 + command.length;
  }
  return frame.buffer;
}
