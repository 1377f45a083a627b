import { defineConfig, loadEnv } from 'vite';
import { with_texts } from './page_texts';

/** What is used here of Node.js's http.IncomingMessage. */
interface Request {
  readonly url?: string | undefined;
  readonly headers: { readonly upgrade?: string | undefined };
}

export default defineConfig(({ mode }) => {
  const target = loadEnv(mode, '.', 'CATGS_')['CATGS_SERVER_URL'] ?? 'http://127.0.0.1:8080';
  return {
    // The server's Content-Security-Policy allows files of its own only: nothing is inlined, and
    // paths are relative so that the page works below any prefix of a reverse proxy.
    base: './',
    plugins: [{ name: 'page-texts', transformIndexHtml: { order: 'pre', handler: with_texts } }],
    build: {
      target: 'es2022',
      assetsInlineLimit: 0,
      modulePreload: false,
      emptyOutDir: true,
      reportCompressedSize: false,
    },
    worker: { format: 'es' },
    // `npm run dev`: pages from here, all else from a catgs-server.
    server: {
      proxy: {
        '/api': { target },
        // The client's socket is at '/' like the page, which stays here; Vite's is at '/?token=…'.
        '^/$': {
          target,
          ws: true,
          bypass: ({ url, headers }: Request) => (headers.upgrade ? undefined : url),
        },
      },
    },
  };
});
