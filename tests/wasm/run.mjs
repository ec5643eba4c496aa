// Draws every case in every format, and exports it, in a WebAssembly module:
//   node run.mjs MODULE.wasm
// Prints each case and the CRC32 of what it gives; exits with 1 where one differs from the table.
import { readFile } from "node:fs/promises";

const [path] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(await readFile(path));
const { memory, cases, columns, name, name_len, draw, unpacks } = instance.exports;
const outcomes = ["", " OTHER", " FAILED", " UNKNOWN"];

let others = unpacks() ? 0 : 1;
for (let column = 0; column < columns(); column++) {
    for (let index = 0; index < cases(); index++) {
        const answer = BigInt.asUintN(64, draw(index, column));
        const outcome = Number(answer >> 32n);
        others += outcome === 0 ? 0 : 1;
        const text = new TextDecoder().decode(new Uint8Array(memory.buffer, name(index), name_len(index)));
        const crc = (answer & 0xffffffffn).toString(16).padStart(8, "0");
        console.log(`${text} ${column} ${crc}${outcomes[outcome]}`);
    }
}
if (cases() === 0 || others > 0) {
    console.log(`${others} of them differ from the table`);
    process.exit(1);
}
