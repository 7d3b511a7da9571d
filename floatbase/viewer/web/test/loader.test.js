import assert from "node:assert/strict";
import {gzipSync} from "node:zlib";
import test from "node:test";
import {canUnpack, joinFrame, splitFrame, unpack, unpackText} from "../src/loader.js";
import {TOO_OLD} from "../src/messages.js";

const bytes = (...values) => Uint8Array.from(values);

test("gzip data is unpacked from bytes and from base64 text", async () => {
  const packed = gzipSync("the code, with τ");
  assert.equal(await unpackText(packed), "the code, with τ");
  assert.equal(await unpackText(packed.toString("base64")), "the code, with τ");
  assert.deepEqual(new Uint8Array(await unpack(gzipSync(bytes(0, 255, 7)))), bytes(0, 255, 7));
});

test("a browser that is too old is named as the cause", async (context) => {
  const stream = globalThis.DecompressionStream;
  context.after(() => { globalThis.DecompressionStream = stream; });
  delete globalThis.DecompressionStream;
  assert.equal(canUnpack(), false);
  await assert.rejects(unpack(gzipSync("x")), new Error(TOO_OLD));
});

test("a frame is its commands, each after its length", () => {
  const commands = [bytes(1, 2, 3), bytes(), bytes(4)];
  const frame = joinFrame(commands);
  assert.deepEqual(
    new Uint8Array(frame), bytes(3, 0, 0, 0, 1, 2, 3, 0, 0, 0, 0, 1, 0, 0, 0, 4),
  );
  assert.deepEqual(splitFrame(frame), commands);
  assert.deepEqual(splitFrame(joinFrame([])), []);
});

test("a frame that is cut off is refused", () => {
  const frame = joinFrame([bytes(1, 2, 3)]);
  assert.throws(() => splitFrame(frame.slice(0, 6)), RangeError);
  assert.throws(() => splitFrame(frame.slice(0, 3)), RangeError);
});
