// A film of pictures in WebM, each at its exact time. A browser's own recorder goes by the clock and leaves out what it has no
// time for; a lossy WebP picture is a key frame of VP8, so pictures that were encoded one by one need only be put together.

const ID = {
  ebml: [0x1a, 0x45, 0xdf, 0xa3], version: [0x42, 0x86], readVersion: [0x42, 0xf7], maxId: [0x42, 0xf2], maxSize: [0x42, 0xf3],
  docType: [0x42, 0x82], docVersion: [0x42, 0x87], docReadVersion: [0x42, 0x85],
  segment: [0x18, 0x53, 0x80, 0x67], info: [0x15, 0x49, 0xa9, 0x66], timeScale: [0x2a, 0xd7, 0xb1], duration: [0x44, 0x89],
  muxer: [0x4d, 0x80], writer: [0x57, 0x41], title: [0x7b, 0xa9],
  tracks: [0x16, 0x54, 0xae, 0x6b], track: [0xae], number: [0xd7], uid: [0x73, 0xc5], type: [0x83], lacing: [0x9c], codec: [0x86],
  frameNs: [0x23, 0xe3, 0x83], video: [0xe0], width: [0xb0], height: [0xba],
  cluster: [0x1f, 0x43, 0xb6, 0x75], time: [0xe7], block: [0xa3],
};
const NS_PER_MS = 1_000_000;
const KEY_FRAME = 0x80;
/** A block counts from its cluster in 16 bits. */
const CLUSTER_MS = 5000;

/**
 * @param {{width: number, height: number, frame_ms: number, title: string}} about
 */
export function createWebm({ width, height, frame_ms, title }) {
  /** @type {{time_ms: number, data: Uint8Array}[]} */
  const frames = [];

  /** @returns {Uint8Array[]} */
  function clusters() {
    /** @type {Uint8Array[]} */
    const made = [];
    for (let i = 0; i < frames.length;) {
      const begin_ms = frames[i].time_ms;
      const blocks = [];
      for (; i < frames.length && frames[i].time_ms - begin_ms < CLUSTER_MS; i += 1) {
        const after_ms = frames[i].time_ms - begin_ms;
        blocks.push(...element(ID.block, Uint8Array.of(0x81, after_ms >> 8, after_ms & 255, KEY_FRAME), frames[i].data));
      }
      made.push(...element(ID.cluster, ...element(ID.time, whole(begin_ms)), ...blocks));
    }
    return made;
  }

  return {
    /** @param {Blob} picture a lossy WebP */
    async add(picture) {
      const data = keyFrameOf(new Uint8Array(await picture.arrayBuffer()));
      frames.push({ time_ms: Math.round(frames.length * frame_ms), data });
    },
    count: () => frames.length,
    /** @returns {Blob} */
    film() {
      const head = element(ID.ebml, ...[[ID.version, 1], [ID.readVersion, 1], [ID.maxId, 4], [ID.maxSize, 8]].flatMap(([id, value]) => element(/** @type {number[]} */ (id), whole(/** @type {number} */ (value)))),
        ...element(ID.docType, text("webm")), ...element(ID.docVersion, whole(4)), ...element(ID.docReadVersion, whole(2)));
      const info = element(ID.info, ...element(ID.timeScale, whole(NS_PER_MS)), ...element(ID.duration, real(frames.length * frame_ms)), ...element(ID.muxer, text("grabberd")), ...element(ID.writer, text("grabberd")), ...element(ID.title, text(title)));
      const video = element(ID.video, ...element(ID.width, whole(width)), ...element(ID.height, whole(height)));
      const track = element(ID.track, ...element(ID.number, whole(1)), ...element(ID.uid, whole(1)), ...element(ID.type, whole(1)), ...element(ID.lacing, whole(0)), ...element(ID.codec, text("V_VP8")), ...element(ID.frameNs, whole(Math.round(frame_ms * NS_PER_MS))), ...video);
      const parts = [...head, ...element(ID.segment, ...info, ...element(ID.tracks, ...track), ...clusters())];
      return new Blob(/** @type {BlobPart[]} */ (parts), { type: "video/webm" });
    },
  };
}

/** The VP8 key frame in a WebP picture. @param {Uint8Array} webp */
export function keyFrameOf(webp) {
  const view = new DataView(webp.buffer, webp.byteOffset, webp.byteLength);
  const name = (/** @type {number} */ at) => String.fromCharCode(...webp.subarray(at, at + 4));
  if (webp.length < 20 || name(0) !== "RIFF" || name(8) !== "WEBP") throw new Error("this browser makes no WebP pictures");
  for (let at = 12; at + 8 <= webp.length;) {
    const length = view.getUint32(at + 4, true);
    if (name(at) === "VP8 ") return webp.subarray(at + 8, at + 8 + length);
    at += 8 + length + (length & 1);
  }
  throw new Error("this browser makes no lossy WebP pictures");
}

/** An element, as parts that need not be copied. @param {number[]} id @param {...Uint8Array} content @returns {Uint8Array[]} */
function element(id, ...content) {
  const head = new Uint8Array(id.length + 8);
  head.set(id);
  const length = content.reduce((sum, part) => sum + part.length, 0);
  new DataView(head.buffer).setBigUint64(id.length, BigInt(length) | (1n << 56n));
  return [head, ...content];
}

/** @param {number} value */
function whole(value) {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setBigUint64(0, BigInt(Math.round(value)));
  return bytes;
}

/** @param {number} value */
function real(value) {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return bytes;
}

/** @param {string} words */
const text = (words) => new TextEncoder().encode(words);
