import { defineConfig } from 'vite';

// The server's Content-Security-Policy allows files of its own only: nothing is inlined, and paths
// are relative so that the page works below any prefix of a reverse proxy.
export default defineConfig({
  base: './',
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    modulePreload: false,
    emptyOutDir: true,
    reportCompressedSize: false,
  },
  worker: { format: 'es' },
});
