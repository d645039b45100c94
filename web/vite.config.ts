import { svelte } from "@sveltejs/vite-plugin-svelte";
import type { ProxyOptions } from "vite";
import { defineConfig } from "vitest/config";

// The server of `npm run dev` hands API calls to a running `outcrop serve`. To that server they have to come from a
// page of its own: it refuses changes from any other origin.
const backend = process.env.OUTCROP_URL ?? "http://127.0.0.1:8000";
const proxy: ProxyOptions = {
  target: backend,
  changeOrigin: true,
  configure: (server) => {
    server.on("proxyReq", (request) => {
      if (request.hasHeader("origin")) request.setHeader("origin", new URL(backend).origin);
    });
  },
};

export default defineConfig({
  plugins: [svelte()],
  build: {
    target: "es2024",
    chunkSizeWarningLimit: 900,
    rolldownOptions: {
      output: { entryFileNames: "assets/[name]-[hash].js", chunkFileNames: "assets/[name]-[hash].js" },
    },
  },
  server: { proxy: { "/api": proxy, "/healthz": proxy } },
  test: { include: ["tests/**/*.test.ts"], environment: "node" },
});
