import { defineConfig, loadEnv, transformWithEsbuild, type Plugin } from 'vite';
import { with_texts } from './page_texts';

/** The part of http.IncomingMessage (Node.js) that this file uses. */
interface Request {
  readonly url?: string | undefined;
  readonly headers: { readonly upgrade?: string | undefined };
}

// The bundler cannot leave out the enumerations that TypeScript makes: a call fills each.
const unused_enums = (code: string): string =>
  code.replace(
    /export var (\w+);\s*\(function \(\1\) \{([^}]*)\}\)\(\1 \|\| \(\1 = \{\}\)\);/g,
    'export const $1 = /*@__PURE__*/ (function ($1) {$2 return $1; })({});',
  );

// Protobuf starts from a description of descriptions. The wire uses none of these parts of it.
const unused_parts = ['extensionRange', 'defaultValue'];
const unused_messages =
  /^((File|Service|Method|Oneof|Enum|EnumValue|ExtensionRange)Options|(Source|Generated)CodeInfo|FeatureSetDefaults|UninterpretedOption)$/;
const without_unused = (code: string): string =>
  code.replace(/ boot\((\{.*\})\);/, (_, description: string) => {
    function used(this: { name?: string }, key: string, value: { packed?: boolean }): unknown {
      const is_unused =
        unused_parts.includes(key) ||
        (key === 'options' && !value.packed) ||
        (['field', 'nestedType', 'enumType'].includes(key) &&
          unused_messages.test(this.name ?? ''));
      return is_unused ? undefined : value;
    }
    return ` boot(${JSON.stringify(JSON.parse(description), used)});`;
  });

// Captions disable these parts of Markdown by name (captions/markdown.ts), so that nothing runs them.
const disabled_part =
  /micromark-core-commonmark\/lib\/(html-flow|html-text|definition|code-indented)\.js$/;
const named_part = (file: string): string => {
  const name = file.replace(/-(\w)/, (_, letter: string) => letter.toUpperCase());
  return `export const ${name} = { name: '${name}' };`;
};

/** Makes files smaller than minifying does. */
const smaller: Plugin = {
  name: 'smaller',
  transform: (code, file) => {
    const [, disabled] = disabled_part.exec(file) ?? [];
    if (disabled) return { code: named_part(disabled), map: null };
    return file.includes('@bufbuild/protobuf')
      ? { code: without_unused(unused_enums(code)), map: null }
      : null;
  },
  // Names of private members end so, and no others do.
  renderChunk: (code, { fileName }) =>
    transformWithEsbuild(code, fileName, { mangleProps: /[^_]_$/, loader: 'js' }),
};

export default defineConfig(({ mode }) => {
  const target = loadEnv(mode, '.', 'CATGS_')['CATGS_SERVER_URL'] ?? 'http://127.0.0.1:8080';
  return {
    // Nothing is inlined, because the server's Content-Security-Policy allows its own files only.
    // Paths are relative, so that the page works below any prefix of a reverse proxy.
    base: './',
    plugins: [
      { name: 'page-texts', transformIndexHtml: { order: 'pre', handler: with_texts } },
      smaller,
    ],
    build: {
      target: 'es2022',
      assetsInlineLimit: 0,
      modulePreload: false,
      emptyOutDir: true,
      reportCompressedSize: false,
    },
    worker: { format: 'es', plugins: () => [smaller] },
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
