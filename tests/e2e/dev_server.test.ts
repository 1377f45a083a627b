// The page as `npm run dev` serves it: Vite serves the files and passes the socket on to a server.
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { afterAll, beforeAll, expect, it } from 'vitest';
import { createServer, type ViteDevServer } from 'vite';
import { new_page } from './support/browser';
import { at_hello, start_fake_server, welcome, type FakeServer } from './support/fake_server';

const client_dir = fileURLToPath(new URL('../../web_client', import.meta.url));

let server: FakeServer;
let vite: ViteDevServer;

beforeAll(async () => {
  server = await start_fake_server(at_hello(welcome()));
  process.env['CATGS_SERVER_URL'] = server.url;
  vite = await createServer({
    root: client_dir,
    configFile: path.join(client_dir, 'vite.config.ts'),
    server: { host: '127.0.0.1', port: 0 },
    logLevel: 'error',
  });
  await vite.listen();
});

afterAll(async () => {
  delete process.env['CATGS_SERVER_URL'];
  await vite.close();
});

it('talks to the server, and leaves Vite its own socket', async () => {
  const { page } = await new_page();
  const vite_connected = page.waitForEvent('console', (line) =>
    line.text().includes('[vite] connected'),
  );
  const url = vite.resolvedUrls!.local[0]!;
  await page.goto(`${url}?scene=garden`);
  await page.getByText('Demo city').waitFor();
  await vite_connected;
  const hello = server.peers[0]!.heard.find((body) => body.case === 'hello');
  expect(hello?.value).toMatchObject({ sceneId: 'garden' });
  const listed = await fetch(new URL('api/scenes', url));
  expect(await listed.json()).toHaveProperty('scenes');
});
