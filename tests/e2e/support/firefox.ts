// Firefox as its makers ship it, over WebDriver BiDi (https://w3c.github.io/webdriver-bidi).
import { spawn } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { WebSocket } from 'ws';
import type { AnyPage } from './camera';
import { clean_up } from './clean_up';
import { artefacts, firefox_path } from './paths';
import { end } from './programs';

interface Reply {
  readonly id?: number;
  readonly method?: string;
  readonly params?: { level?: string; text?: string; source?: { context?: string } };
  readonly result?: Record<string, unknown>;
  readonly message?: string; // of an error
}

type Command = (method: string, params: object) => Promise<Record<string, unknown>>;

type Point = readonly [x: number, y: number];

export interface FirefoxPage extends AnyPage {
  readonly errors: string[];
  /** Resolves when the expression is true; fails after a minute. */
  until(expression: string): Promise<void>;
  /** Clicks the middle of the first element that matches, or a point of the window. */
  click(where: string | Point): Promise<void>;
  drag(from: Point, by: Point): Promise<void>;
  press(key: string): Promise<void>;
  keep_screenshot(name: string): Promise<void>;
}

let firefox: Command;
const errors_of = new Map<string | undefined, string[]>(); // by context

/** Starts the Firefox that all tests of a file share, before them. */
export async function start_firefox(): Promise<void> {
  firefox = await connect(await launch());
  await firefox('session.new', { capabilities: {} });
  await firefox('session.subscribe', { events: ['log.entryAdded'] });
}

/** Opens the address in a tab that is closed after the test. */
export async function open_in_firefox(
  url: string,
  width: number,
  height: number,
): Promise<FirefoxPage> {
  const { context } = (await firefox('browsingContext.create', { type: 'tab' })) as {
    context: string;
  };
  const errors: string[] = [];
  errors_of.set(context, errors);
  clean_up(() => firefox('browsingContext.close', { context }));
  await firefox('browsingContext.setViewport', { context, viewport: { width, height } });
  await firefox('browsingContext.navigate', { context, url, wait: 'complete' });
  return page_of(firefox, context, errors);
}

function page_of(command: Command, context: string, errors: string[]): FirefoxPage {
  const evaluate = async <T>(what: string | (() => T | Promise<T>)): Promise<T> => {
    const expression = typeof what === 'string' ? what : `(${what.toString()})()`;
    const { result, exceptionDetails } = (await command('script.evaluate', {
      expression: `(async () => JSON.stringify(await (${expression})))()`,
      target: { context },
      awaitPromise: true,
    })) as { result?: { value?: string }; exceptionDetails?: { text: string } };
    if (exceptionDetails) throw new Error(exceptionDetails.text);
    return JSON.parse(result?.value ?? 'null') as T;
  };
  const pointer = (actions: object[]): Promise<unknown> =>
    command('input.performActions', {
      context,
      actions: [{ type: 'pointer', id: 'mouse', actions }],
    });
  const move = ([x, y]: Point, duration = 0): object => ({ type: 'pointerMove', x, y, duration });
  const [down, up] = ['pointerDown', 'pointerUp'].map((type) => ({ type, button: 0 })) as [
    object,
    object,
  ];
  return {
    errors,
    evaluate,
    until: async (expression) => {
      const end_ms = Date.now() + 60_000;
      while (!(await evaluate<boolean>(`Boolean(${expression})`))) {
        if (Date.now() > end_ms) throw new Error(`never true: ${expression}`);
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    },
    click: async (where) => {
      const middle = `(element) => {
        element.scrollIntoView({ block: 'nearest' });
        const { x, y, width, height } = element.getBoundingClientRect();
        return [Math.round(x + width / 2), Math.round(y + height / 2)];
      }`;
      const at =
        typeof where === 'string'
          ? evaluate<Point>(`(${middle})(document.querySelector('${where}'))`)
          : where;
      await pointer([move(await at), down, up]);
    },
    drag: async ([x, y], [dx, dy]) => {
      await pointer([move([x, y]), down, move([x + dx, y + dy], 300), up]);
    },
    press: async (value) => {
      const actions = ['keyDown', 'keyUp'].map((type) => ({ type, value }));
      await command('input.performActions', {
        context,
        actions: [{ type: 'key', id: 'keys', actions }],
      });
    },
    keep_screenshot: async (name) => {
      const { data } = (await command('browsingContext.captureScreenshot', { context })) as {
        data: string;
      };
      mkdirSync(artefacts, { recursive: true });
      writeFileSync(path.join(artefacts, `${name}.png`), Buffer.from(data, 'base64'));
    },
  };
}

/** Returns the address where Firefox listens. */
function launch(): Promise<string> {
  const profile = mkdtempSync(path.join(tmpdir(), 'catgs-firefox-'));
  const child = spawn(
    firefox_path,
    [
      '--headless',
      '--no-remote',
      '--profile',
      profile,
      '--remote-debugging-port',
      '0',
      'about:blank',
    ],
    { stdio: ['ignore', 'ignore', 'pipe'] },
  );
  clean_up(async () => {
    await end(child, 'SIGKILL');
    rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
  });
  return new Promise((resolve, reject) => {
    let said = '';
    child.stderr.on('data', (chunk: Buffer) => {
      said += chunk.toString();
      const address = /WebDriver BiDi listening on (ws:\S+)/.exec(said)?.[1];
      if (address) resolve(address);
    });
    child.once('error', reject);
    child.once('exit', (code) => reject(new Error(`Firefox ended with ${code}:\n${said}`)));
  });
}

async function connect(address: string): Promise<Command> {
  const socket = new WebSocket(`${address}/session`);
  await new Promise((resolve, reject) => socket.once('open', resolve).once('error', reject));
  clean_up(() => socket.terminate());
  const waiting = new Map<number, (reply: Reply) => void>();
  socket.on('message', (data) => {
    const reply = JSON.parse((data as Buffer).toString()) as Reply;
    if (reply.id !== undefined) waiting.get(reply.id)?.(reply);
    else if (reply.params?.level === 'error')
      errors_of.get(reply.params.source?.context)?.push(reply.params.text ?? '');
  });
  let commands = 0;
  return (method, params) =>
    new Promise((resolve, reject) => {
      const id = ++commands;
      waiting.set(id, ({ result, message }) => {
        waiting.delete(id);
        if (result) resolve(result);
        else reject(new Error(`${method}: ${message}`));
      });
      socket.send(JSON.stringify({ id, method, params }));
    });
}
