// A clock that tests move by hand, a socket whose other end is the test, and a storage in memory.
import { create, fromBinary, toBinary, type MessageInitShape } from '@bufbuild/protobuf';
import type { Clock, Timers } from '#client/base/clock';
import type { OpenSocket, SocketEvents } from '#client/transport/socket';
import {
  ClientMessageSchema,
  FrameHeaderSchema,
  ServerMessageSchema,
  type ClientMessage,
} from '#client/wire/wire';

export function fake_storage(): Storage {
  const values = new Map<string, string>();
  return {
    getItem: (key: string) => values.get(key) ?? null,
    setItem: (key: string, value: string) => void values.set(key, value),
  } as Storage;
}

export class FakeTime implements Clock, Timers {
  private now_ms_ = 0;
  private timers_: { due_ms: number; action: () => void }[] = [];

  now_us(): number {
    return this.now_ms_ * 1000;
  }

  after(delay_ms: number, action: () => void): () => void {
    const timer = { due_ms: this.now_ms_ + delay_ms, action };
    this.timers_.push(timer);
    return () => {
      this.timers_ = this.timers_.filter((other) => other !== timer);
    };
  }

  advance(ms: number): void {
    const end_ms = this.now_ms_ + ms;
    for (;;) {
      const next = [...this.timers_].sort((a, b) => a.due_ms - b.due_ms)[0];
      if (!next || next.due_ms > end_ms) break;
      this.timers_ = this.timers_.filter((other) => other !== next);
      this.now_ms_ = Math.max(this.now_ms_, next.due_ms);
      next.action();
    }
    this.now_ms_ = end_ms;
  }
}

type ServerBody = NonNullable<MessageInitShape<typeof ServerMessageSchema>['body']>;

export class FakeSocket {
  readonly heard: ClientMessage['body'][] = [];
  closed = false;
  buffered_bytes = 0;

  constructor(readonly events: SocketEvents) {}

  say(body: ServerBody): void {
    const bytes = toBinary(ServerMessageSchema, create(ServerMessageSchema, { body }));
    this.events.message(new Uint8Array([1, ...bytes]).buffer);
  }

  frame(header: MessageInitShape<typeof FrameHeaderSchema>): void {
    const bytes = toBinary(FrameHeaderSchema, create(FrameHeaderSchema, header));
    this.events.message(new Uint8Array([2, bytes.length, ...bytes, 0xab]).buffer);
  }

  /** The messages of one kind that the client sent. */
  sent<K extends ClientMessage['body']['case']>(
    kind: K,
  ): Extract<ClientMessage['body'], { case: K }>['value'][] {
    return this.heard.flatMap((body) => (body.case === kind ? [body.value as never] : []));
  }
}

/** Opens sockets that the test holds in `sockets`, in order. */
export function fake_network(): { open: OpenSocket; sockets: FakeSocket[] } {
  const sockets: FakeSocket[] = [];
  const open: OpenSocket = (events) => {
    const socket = new FakeSocket(events);
    sockets.push(socket);
    return {
      send: (bytes) => socket.heard.push(fromBinary(ClientMessageSchema, bytes).body),
      buffered_bytes: () => socket.buffered_bytes,
      close: () => {
        socket.closed = true;
      },
    };
  };
  return { open, sockets };
}
