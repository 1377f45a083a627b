// The real programs: catgs-render, and catgs-server on a port that the system chooses.
import { execFileSync, spawn, type ChildProcess } from 'node:child_process';
import { existsSync, mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { clean_up } from './clean_up';
import { build_dir } from './paths';

function program(name: string): string {
  const file = path.join(build_dir, 'bin', name);
  if (!existsSync(file)) throw new Error(`${file} is missing: ninja -C ${build_dir} ${name}`);
  return file;
}

/** Runs catgs-render; throws with its error output when it fails. */
export function catgs_render(...args: string[]): void {
  execFileSync(program('catgs-render'), args, { stdio: ['ignore', 'ignore', 'pipe'] });
}

const key_file = path.join(mkdtempSync(path.join(tmpdir(), 'catgs-key-')), 'key');
writeFileSync(key_file, '0123456789abcdef0123456789abcdef');

/** Makes a server take the tokens of access_token(). */
export const with_tokens = ['--token-key-file', key_file];

const tokens = new Map<string, string>();

/** Makes an access token with `catgs-server token`. */
export function access_token(role: string): string {
  const args = ['token', '--role', role, ...with_tokens];
  const token =
    tokens.get(role) ??
    execFileSync(program('catgs-server'), args, { stdio: ['ignore', 'pipe', 'ignore'] })
      .toString()
      .trim();
  tokens.set(role, token);
  return token;
}

export interface RunningServer {
  readonly url: string;
  readonly port: number;
  /** Its log so far. */
  log(): string;
  /** Ends it like a crash (SIGKILL) or like an operator (SIGTERM). Resolves when it has ended. */
  stop(signal?: 'SIGKILL' | 'SIGTERM'): Promise<void>;
}

/** Resolves when the server says where it listens; rejects with its log when it ends before. */
export async function start_server(scene: string, args: string[] = []): Promise<RunningServer> {
  const child = spawn(
    program('catgs-server'),
    // No proxy watches /readyz here, and there is no other server to go to. The rate is enough to see motion.
    [
      ...['--scene', scene, '--port', '0', '--admin-bind', 'off', '--fps', '20'],
      ...['--drain-wait', '0', '--drain-deadline', '1'],
      ...args,
    ],
    { stdio: ['ignore', 'pipe', 'pipe'] },
  );
  clean_up(() => end(child, 'SIGKILL'));
  let log = '';
  const url = await new Promise<string>((resolve, reject) => {
    const read = (chunk: Buffer): void => {
      log += chunk.toString();
      const match = /open (https?:\/\/\S+?:\d+\/)/.exec(log);
      if (match?.[1]) resolve(match[1]);
    };
    child.stdout.on('data', read);
    child.stderr.on('data', read);
    child.once('error', reject);
    child.once('exit', (code) => reject(new Error(`catgs-server ended with ${code}:\n${log}`)));
  });
  return {
    url,
    port: Number(new URL(url).port),
    log: () => log,
    stop: (signal = 'SIGTERM') => end(child, signal),
  };
}

export function end(child: ChildProcess, signal: 'SIGKILL' | 'SIGTERM'): Promise<void> {
  return new Promise((resolve) => {
    if (child.exitCode !== null || child.signalCode !== null) {
      resolve();
      return;
    }
    child.once('exit', () => resolve());
    child.kill(signal);
  });
}
