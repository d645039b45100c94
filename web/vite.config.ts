import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vitest/config";

// The server of `npm run dev` hands API calls to a running `outcrop serve`.
const backend = process.env.OUTCROP_URL ?? "http://127.0.0.1:8000";

export default defineConfig({
  plugins: [svelte()],
  build: {
    target: "es2024",
    chunkSizeWarningLimit: 900,
    rolldownOptions: {
      output: { entryFileNames: "assets/[name]-[hash].js", chunkFileNames: "assets/[name]-[hash].js" },
    },
  },
  server: { proxy: { "/api": backend, "/healthz": backend } },
  test: { include: ["tests/**/*.test.ts"], environment: "node" },
});
