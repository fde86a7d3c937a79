// Decoder for the data of hil/view/packed.py: whole numbers as differences, times a step.

/** Decode one list of numbers. */
export function unpack({ step, differences }) {
  const values = new Float64Array(differences.length);
  let sum = 0;
  for (let i = 0; i < differences.length; i++) {
    sum += differences[i] ?? 0;
    values[i] = differences[i] === null ? NaN : sum * step;
  }
  return values;
}

/** Parse a page's data: base64 of gzip of JSON. */
export async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return JSON.parse(await new Response(stream).text());
}
