// What a client says of itself does not get through HAProxy as the compose file runs it.
import { get } from 'node:http';
import { beforeAll, expect, it } from 'vitest';
import { start_haproxy } from './support/haproxy';
import { start_server } from './support/programs';
import { scratch_folder } from './support/scenes';

let proxy: string; // its address

beforeAll(async () => {
  const options = ['--bind', '0.0.0.0', '--open', '--trusted-proxy', '127.0.0.1'];
  const server = await start_server('synth:city:2000', options);
  proxy = await start_haproxy(scratch_folder(), [server.port, server.port]);
});

function ask(headers: Record<string, string>): Promise<{ status: number; text: string }> {
  return new Promise((resolve, reject) => {
    get(proxy, { headers, agent: false }, (reply) => {
      let text = '';
      reply.on('data', (chunk: Buffer) => (text += chunk.toString()));
      reply.on('end', () => resolve({ status: reply.statusCode ?? 0, text }));
    }).on('error', reject);
  });
}

/** A page may send this header to its own name, which may resolve to the proxy by now. */
it('no page claims TLS, by which the server would answer to its name', async () => {
  const tls = { 'x-forwarded-proto': 'https' };
  expect((await ask({ ...tls, host: 'evil.example' })).status).toBe(403);
  const here = await ask({ ...tls, host: '127.0.0.1:8080' });
  expect(here.status).toBe(200);
  expect(here.text).toContain('content="http://127.0.0.1:8080/');
});
