// What openapi-typescript makes of the service's page, used as a stranger would: JSON, a file, a batch and a job.
import { writeFileSync } from "node:fs";
import createClient from "openapi-fetch";
import type { paths } from "./api.js";

const [, , baseUrl, token] = process.argv;
const client = createClient<paths>({ baseUrl, headers: { Authorization: `Bearer ${token}` } });
const query = { te: 0.03, gamma: 7, s: 0.25, resolution: "16" };
const path = { solver: "dehydration" };

function sure<T>(value: T | undefined, error: unknown): T {
  if (value === undefined) throw new Error(JSON.stringify(error));
  return value;
}

const info = await client.GET("/v1/shapes/{solver}/info", { params: { path, query } });
const said = sure(info.data, info.error);
const value: number = said.stage.value;

const file = await client.GET("/v1/shapes/{solver}", {
  params: { path, query: { ...query, format: "glb" } },
  parseAs: "arrayBuffer",
});
writeFileSync("shape.glb", new Uint8Array(sure(file.data, file.error) as unknown as ArrayBuffer));

const batch = await client.POST("/v1/shapes:batch", {
  body: { solver: "dehydration", points: [{ te: 0.03, gamma: 7, s: 0.1 }], format: "npz", resolution: 16 },
  parseAs: "arrayBuffer",
});
writeFileSync("batch.npz", new Uint8Array(sure(batch.data, batch.error) as unknown as ArrayBuffer));

const asked = await client.POST("/v1/jobs", {
  body: {
    solver: "dehydration",
    preset: "sphere",
    params: { te: 0.04 },
    need: { stages: [0.05], quality: "preview", fields: ["volume"] },
  } as never,
});
let job = sure(asked.data, asked.error);
while (job.state === "wanted" || job.state === "running") {
  await new Promise((done) => setTimeout(done, 200));
  const again = await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } });
  job = sure(again.data, again.error);
}
const numbers = await client.GET("/v1/jobs/{id}/fields", { params: { path: { id: job.id } } });
const dims: string[] = sure(numbers.data, numbers.error).fields["volume"].dims;

const refused = await client.GET("/v1/shapes/{solver}/info", { params: { path, query: { ...query, te: 9 } } });
console.log(JSON.stringify({ value, state: job.state, dims, refused: refused.error?.title }));
