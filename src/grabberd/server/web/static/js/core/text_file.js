// The text of a file: UTF-8, or UTF-16 with a byte order mark, as spreadsheet programs write it.

/** @param {Blob} file @throws {TypeError} it is in another encoding */
export async function textOf(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  const [first, second] = bytes;
  const encoding = first === 0xff && second === 0xfe ? "utf-16le" : first === 0xfe && second === 0xff ? "utf-16be" : "utf-8";
  return new TextDecoder(encoding, { fatal: true }).decode(bytes);
}
