// What JavaScript holds after a collection, of a page or of its worker, through the DevTools protocol.
import type { CDPSession } from 'playwright-core';

/** Sends a command without parameters; resolves with its result. */
export type SendCommand = (method: string) => Promise<unknown>;

/**
 * Commands to the page's worker. Playwright's sessions speak to pages only, so that they travel inside
 * messages of the page's session.
 */
export async function attach_to_worker(page: CDPSession): Promise<SendCommand> {
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
  const waiting = new Map<number, (reply: { result?: unknown; error?: unknown }) => void>();
  page.on('Target.receivedMessageFromTarget', ({ sessionId, message }) => {
    if (sessionId !== session) return;
    const reply = JSON.parse(message) as { id?: number; result?: unknown; error?: unknown };
    if (reply.id !== undefined) waiting.get(reply.id)?.(reply);
  });
  let last_id = 0;
  return async (method) => {
    const id = ++last_id;
    const replied = new Promise<{ result?: unknown; error?: unknown }>((resolve) => {
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
  };
}

export async function heap_bytes(send: SendCommand): Promise<number> {
  await send('HeapProfiler.collectGarbage');
  return ((await send('Runtime.getHeapUsage')) as { usedSize: number }).usedSize;
}
