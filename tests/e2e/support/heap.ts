// Measures the memory that scripts of a page or its worker hold, over the DevTools protocol.
import type { CDPSession } from 'playwright-core';

/** A page or a worker: one heap of V8. */
export interface HeapOwner {
  /** Sends a command without parameters; resolves with its result. */
  send(method: string): Promise<unknown>;
  /** Takes the pieces of heap snapshots from now on. */
  take_chunks(take: (chunk: string) => void): void;
}

const chunk_event = 'HeapProfiler.addHeapSnapshotChunk';

export function heap_of_page(page: CDPSession): HeapOwner {
  let take: (chunk: string) => void = () => undefined;
  page.on(chunk_event, ({ chunk }) => take(chunk));
  return {
    send: (method) => page.send(method as 'HeapProfiler.enable'),
    take_chunks: (taker) => (take = taker),
  };
}

interface Message {
  readonly id?: number;
  readonly method?: string;
  readonly params?: { readonly chunk: string };
  readonly result?: unknown;
  readonly error?: unknown;
}

/**
 * The heap of the page's worker. Playwright's sessions speak to pages only, so commands for a worker
 * travel inside messages of the page's session.
 */
export async function heap_of_worker(page: CDPSession): Promise<HeapOwner> {
  const attached = new Promise<string>((resolve) => {
    page.on('Target.attachedToTarget', ({ sessionId, targetInfo }) => {
      if (targetInfo.type === 'worker') resolve(sessionId);
    });
  });
  await page.send('Target.setAutoAttach', {
    autoAttach: true,
    waitForDebuggerOnStart: false,
    flatten: false,
  });
  const session = await attached;
  const waiting = new Map<number, (reply: Message) => void>();
  let take: (chunk: string) => void = () => undefined;
  page.on('Target.receivedMessageFromTarget', ({ sessionId, message }) => {
    if (sessionId !== session) return;
    const said = JSON.parse(message) as Message;
    if (said.id !== undefined) waiting.get(said.id)?.(said);
    else if (said.method === chunk_event && said.params) take(said.params.chunk);
  });
  let last_id = 0;
  return {
    send: async (method) => {
      const id = ++last_id;
      const replied = new Promise<Message>((resolve) => {
        waiting.set(id, resolve);
      });
      await page.send('Target.sendMessageToTarget', {
        sessionId: session,
        message: JSON.stringify({ id, method }),
      });
      const { result, error } = await replied;
      waiting.delete(id);
      if (error) throw new Error(`${method}: ${JSON.stringify(error)}`);
      return result;
    },
    take_chunks: (taker) => (take = taker),
  };
}

/** The total. It includes compiled code, which V8 makes and discards as it sees fit. */
export async function heap_bytes(heap: HeapOwner): Promise<number> {
  await heap.send('HeapProfiler.collectGarbage');
  return ((await heap.send('Runtime.getHeapUsage')) as { usedSize: number }).usedSize;
}

/** Memory that scripts hold, by class. */
export type Held = ReadonlyMap<string, { readonly count: number; readonly bytes: number }>;

/** Kinds of nodes that scripts make. All others belong to the engine: code, shapes, the inside of the DOM. */
const made_by_scripts = new Set([
  ...['object', 'array', 'closure', 'number', 'bigint', 'string', 'concatenated string'],
  ...['sliced string', 'regexp', 'symbol'],
]);

interface Snapshot {
  readonly snapshot: {
    readonly meta: {
      readonly node_fields: readonly string[];
      readonly node_types: readonly [readonly string[], ...unknown[]];
    };
  };
  readonly nodes: readonly number[];
  readonly strings: readonly string[];
}

/** Takes a heap snapshot, which first collects what nobody holds. */
export async function held_by_scripts(heap: HeapOwner): Promise<Held> {
  const chunks: string[] = [];
  heap.take_chunks((chunk) => chunks.push(chunk));
  await heap.send('HeapProfiler.takeHeapSnapshot');
  heap.take_chunks(() => undefined);
  const { snapshot, nodes, strings } = JSON.parse(chunks.join('')) as Snapshot;
  const { node_fields: fields, node_types } = snapshot.meta;
  const [type_at, name_at, size_at] = ['type', 'name', 'self_size'].map((f) => fields.indexOf(f));
  const held = new Map<string, { count: number; bytes: number }>();
  for (let i = 0; i < nodes.length; i += fields.length) {
    const type = node_types[0][nodes[i + type_at!]!]!;
    if (!made_by_scripts.has(type)) continue;
    // Objects are named by their class, strings by their text.
    const is_named = type === 'object' || type === 'closure' || type === 'array';
    const name = is_named ? `${type} ${strings[nodes[i + name_at!]!]}` : type;
    const before = held.get(name) ?? { count: 0, bytes: 0 };
    held.set(name, {
      count: before.count + 1,
      bytes: before.bytes + nodes[i + size_at!]!,
    });
  }
  return held;
}

export const bytes_of = (held: Held): number =>
  [...held.values()].reduce((sum, { bytes }) => sum + bytes, 0);

/** The classes that grew most, as text for people. */
export function what_grew(before: Held, after: Held): string {
  return [...after]
    .map(([name, { count, bytes }]) => {
      const was = before.get(name) ?? { count: 0, bytes: 0 };
      return { name, count: count - was.count, bytes: bytes - was.bytes };
    })
    .filter(({ bytes }) => bytes > 0)
    .sort((a, b) => b.bytes - a.bytes)
    .slice(0, 8)
    .map(({ name, count, bytes }) => `${name} +${count} (${bytes} bytes)`)
    .join(', ');
}
