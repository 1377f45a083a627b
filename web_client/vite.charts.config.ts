import { defineConfig, type Plugin } from 'vite';

/** Puts script and style into the page: it is one file, which reports of catgs-load are made from. */
const one_file: Plugin = {
  name: 'one-file',
  enforce: 'post',
  generateBundle(_, bundle) {
    const taken = (name: string): string => {
      const part = bundle[name];
      if (!part) throw new Error(`charts.html: there is no ${name}`);
      Reflect.deleteProperty(bundle, name);
      return part.type === 'chunk' ? part.code : String(part.source);
    };
    const page = bundle['charts.html'];
    if (page?.type !== 'asset') throw new Error('there is no charts.html');
    page.source = String(page.source)
      .replace(
        /<link rel="stylesheet"[^>]* href="\.\/([^"]+)">/g,
        (_tag, name: string) => `<style>${taken(name)}</style>`,
      )
      .replace(
        /<script type="module"[^>]* src="\.\/([^"]+)"><\/script>/g,
        (_tag, name: string) => `<script type="module">${taken(name)}</script>`,
      );
    if (Object.keys(bundle).length > 1)
      throw new Error(`charts.html lacks ${Object.keys(bundle).join(', ')}`);
  },
};

export default defineConfig({
  base: './',
  plugins: [one_file],
  publicDir: false,
  build: {
    target: 'es2022',
    modulePreload: false,
    emptyOutDir: false,
    reportCompressedSize: false,
    rollupOptions: { input: 'charts.html' },
  },
});
