// Runs HAProxy as the compose file does, in front of servers of this machine.
import { spawn } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { createServer, type AddressInfo } from 'node:net';
import path from 'node:path';
import { clean_up } from './clean_up';
import { haproxy_path, source_dir } from './paths';
import { end } from './programs';

function free_port(): Promise<number> {
  return new Promise((resolve) => {
    const server = createServer().listen(0, '127.0.0.1', () => {
      const { port } = server.address() as AddressInfo;
      server.close(() => resolve(port));
    });
  });
}

/** docker/haproxy.cfg with addresses of this machine. */
function configuration(port: number, servers: readonly number[]): string {
  const text = readFileSync(path.join(source_dir, 'docker', 'haproxy.cfg'), 'utf8')
    .replace(/^resolvers [\s\S]*?\n\n/m, '')
    .replace(' resolvers engine init-addr none', '')
    .replace('bind :8080', `bind 127.0.0.1:${port}`)
    .replace(/^frontend stats[\s\S]*$/m, '');
  return servers.reduce(
    (result, to, i) => result.replace(`catgs-${i + 1}:8080`, `127.0.0.1:${to}`),
    text,
  );
}

/** Resolves when both servers are known to be ready. Returns its address. */
export async function start_haproxy(folder: string, servers: readonly number[]): Promise<string> {
  const port = await free_port();
  const file = path.join(folder, 'haproxy.cfg');
  writeFileSync(file, configuration(port, servers));
  const child = spawn(haproxy_path, ['-db', '-f', file], { stdio: ['ignore', 'ignore', 'pipe'] });
  clean_up(() => end(child, 'SIGKILL'));
  let log = '';
  child.stderr.on('data', (chunk: Buffer) => (log += chunk.toString()));
  const url = `http://127.0.0.1:${port}/`;
  for (let tries = 0; ; ++tries) {
    if (child.exitCode !== null || tries > 200) throw new Error(`haproxy does not answer:\n${log}`);
    const reply = await fetch(`${url}readyz`).catch(() => null);
    if (reply?.status === 200) return url;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}
