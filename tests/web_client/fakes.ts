// A clock that tests move by hand, a socket whose other end is the test, and a storage in memory.
import { create, fromBinary, toBinary, type MessageInitShape } from '@bufbuild/protobuf';
import type { Clock, Timers } from '#client/base/clock';
import { Session } from '#client/session/session';
import type { SessionState } from '#client/session/state';
import type { OpenSocket, SocketEvents } from '#client/transport/socket';
import {
  ClientMessageSchema,
  Codec,
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

  /** Timers that were due meanwhile fire once, afterwards. */
  sleep(ms: number): void {
    this.now_ms_ += ms;
    this.advance(0);
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

const ignore = (): void => undefined;

/** A session over sockets of the test, and what it told the page. */
export class FakeSession {
  readonly time = new FakeTime();
  readonly sockets: FakeSocket[] = [];
  readonly states: SessionState[] = [];
  readonly notices: string[] = [];
  readonly session: Session;

  constructor(listener: Partial<ConstructorParameters<typeof Session>[1]>) {
    this.session = new Session(
      { open: this.open, clock: this.time, timers: this.time, random: () => 0.5 },
      {
        state: (state) => this.states.push(state),
        notice: (message) => this.notices.push(message),
        welcome: ignore,
        config: ignore,
        frame: ignore,
        stream_ended: ignore,
        stats: ignore,
        picked: ignore,
        hidden_markers: ignore,
        pinged: ignore,
        participants: ignore,
        lead: ignore,
        stayed: ignore,
        ...listener,
      },
      {
        sceneId: 'city',
        viewportWidthPx: 640,
        viewportHeightPx: 360,
        decoders: [Codec.H264],
        token: 'secret',
      },
    );
  }

  get last_state(): SessionState | undefined {
    return this.states.at(-1);
  }

  /** The connections that the session opened, in order. */
  socket(i: number): FakeSocket {
    const found = this.sockets[i];
    if (!found) throw new Error(`connection ${i} was not opened`);
    return found;
  }

  private readonly open: OpenSocket = (events) => {
    const socket = new FakeSocket(events);
    this.sockets.push(socket);
    return {
      send: (bytes) => socket.heard.push(fromBinary(ClientMessageSchema, bytes).body),
      buffered_bytes: () => socket.buffered_bytes,
      close: () => {
        socket.closed = true;
      },
    };
  };
}
