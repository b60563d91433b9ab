// Reads a log with Foxglove's own packages and prints what it finds as one JSON object: for each topic the number
// of messages, and of the messages asked for, their fields.
//
//     node read.mjs LOG FRAME [FRAME ...]      packages: @mcap/core, @mcap/support, @mcap/nodejs
//
// RIG_NODE_MODULES names the folder of the packages.
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const need = createRequire(join(resolve(process.env.RIG_NODE_MODULES), "..", "index.js"));
const { McapIndexedReader } = need("@mcap/core");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = need("@mcap/support");
const { FileHandleReadable } = need("@mcap/nodejs");

const [log, ...frames] = process.argv.slice(2);
const wanted = new Set(frames.map(Number));

// NaN and the infinities are no JSON: as words.
const plain = (_, value) => (typeof value === "number" && !Number.isFinite(value) ? String(value) : value);

function decoder(schema) {
  const type = protobufFromBinaryDescriptor(schema.data).lookupType(schema.name);
  return (data) => type.toObject(type.decode(data), { enums: String, longs: Number, defaults: true });
}

const file = await open(log, "r");
const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(file),
  decompressHandlers: await loadDecompressHandlers(),
});
const decode = new Map([...reader.schemasById].map(([id, schema]) => [id, decoder(schema)]));
const found = { counts: {}, messages: {}, metadata: {}, start: Number(reader.statistics.messageStartTime) };
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  found.counts[channel.topic] = (found.counts[channel.topic] ?? 0) + 1;
  if (wanted.has(message.sequence) || channel.topic === "/events") {
    const said = { time: Number(message.logTime), ...decode.get(channel.schemaId)(message.data) };
    ((found.messages[channel.topic] ??= {})[message.sequence] ??= []).push(said);
  }
}
for await (const record of reader.readMetadata()) found.metadata[record.name] = Object.fromEntries(record.metadata);
await file.close();
console.log(JSON.stringify(found, plain));
