import { defineConfig } from "vite";

// Two pages, one build: the viewer at / and the API's documentation at /docs. Paths are relative, so that both work
// behind a prefix; every asset carries its hash, so that it may be cached for ever.
export default defineConfig({
  base: "./",
  build: {
    target: "es2022",
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 2000,
    reportCompressedSize: false,
    rollupOptions: { input: ["index.html", "docs.html"] },
  },
  // `npm run dev` beside a running `wizen serve`
  server: { proxy: { "/v1": "http://127.0.0.1:8765", "/openapi.json": "http://127.0.0.1:8765" } },
});
