// Reads a log from its first byte to its last with Foxglove's reader of streams, which has no index, and prints for
// each topic the number of messages and whether their times rise, as one JSON object.
//
//     node stream.mjs LOG      packages: @mcap/core, @mcap/support in RIG_NODE_MODULES
import { createReadStream } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const need = createRequire(join(resolve(process.env.RIG_NODE_MODULES), "..", "index.js"));
const { McapStreamReader } = need("@mcap/core");
const { loadDecompressHandlers } = need("@mcap/support");

const reader = new McapStreamReader({ decompressHandlers: await loadDecompressHandlers(), validateCrcs: true });
const topics = new Map();
const found = {};
for await (const bytes of createReadStream(process.argv[2], { highWaterMark: 4096 })) {
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type !== "Message") continue;
    const topic = (found[topics.get(record.channelId)] ??= { count: 0, last: -1, rising: true });
    topic.count += 1;
    topic.rising &&= Number(record.logTime) >= topic.last;
    topic.last = Number(record.logTime);
  }
}
console.log(JSON.stringify({ done: reader.done(), topics: found }));
