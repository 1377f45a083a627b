import { defineConfig, loadEnv } from 'vite';
import { with_texts } from './page_texts';

/** The part of http.IncomingMessage (Node.js) that this file uses. */
interface Request {
  readonly url?: string | undefined;
  readonly headers: { readonly upgrade?: string | undefined };
}

export default defineConfig(({ mode }) => {
  const target = loadEnv(mode, '.', 'CATGS_')['CATGS_SERVER_URL'] ?? 'http://127.0.0.1:8080';
  return {
    // Nothing is inlined, because the server's Content-Security-Policy allows its own files only.
    // Paths are relative, so that the page works below any prefix of a reverse proxy.
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
    // `npm run dev` serves the page from here and all else from a catgs-server.
    server: {
      proxy: {
        '/api': { target },
        // The client's socket is at '/', like the page that Vite serves. Vite's own is at '/?token=…'.
        '^/$': {
          target,
          ws: true,
          bypass: ({ url, headers }: Request) => (headers.upgrade ? undefined : url),
        },
      },
    },
  };
});
