import type { Clock, Timers } from '../base/clock';
import type { OpenSocket, Socket } from '../transport/socket';
import {
  decode_server_message,
  encode_client_message,
  type ClientBody,
  type HelloInit,
  type Incoming,
  type StreamConfig,
  type Welcome,
} from '../wire/wire';
import type { WaitCause } from './state';

export const silence_ms = 3000; // the server speaks at least once a second
export const greeting_ms = 10_000; // to open the connection and to be answered the first time

const restart_code = 1012; // of servers that take nobody in any more

interface LinkEnvironment {
  open: OpenSocket;
  clock: Clock;
  timers: Timers;
}

/** One connection: it says hello, hears messages, and notices when the server falls silent. */
export class Link {
  /** What the server has said so far. */
  welcome: Welcome | undefined;
  config: StreamConfig | undefined;
  welcomed_us = 0;
  private readonly socket_: Socket;
  private opened_ = false;
  private heard_us_: number;
  private cancel_watch_: () => void = () => undefined;

  /** `hello` is asked when the connection is open. `lost` does not close the link: its listener does. */
  constructor(
    private readonly env_: LinkEnvironment,
    hello: () => HelloInit,
    private readonly listener_: {
      heard(incoming: Incoming): void;
      lost(cause: WaitCause, message: string): void;
    },
  ) {
    this.heard_us_ = env_.clock.now_us();
    this.socket_ = env_.open({
      opened: () => {
        this.opened_ = true;
        this.send({ case: 'hello', value: hello() });
      },
      message: (data) => this.heard(data),
      closed: (code, reason) => {
        const cause = code === restart_code ? 'updating' : this.opened_ ? 'lost' : 'unreachable';
        listener_.lost(cause, reason);
      },
    });
    this.watch();
  }

  send(body: ClientBody): void {
    this.socket_.send(encode_client_message(body));
  }

  /** Bytes that the network has not taken yet. */
  buffered_bytes(): number {
    return this.socket_.buffered_bytes();
  }

  /** No event follows. */
  close(): void {
    this.cancel_watch_();
    this.socket_.close();
  }

  private heard(data: ArrayBuffer): void {
    this.heard_us_ = this.env_.clock.now_us();
    let incoming;
    try {
      incoming = decode_server_message(data);
    } catch (error) {
      this.listener_.lost('lost', String(error));
      return;
    }
    this.listener_.heard(incoming);
  }

  /** Reports a link that stays silent for too long. Looks again when the time could be up. */
  private watch(): void {
    const limit_ms = this.welcome ? silence_ms : greeting_ms;
    const quiet_ms = (this.env_.clock.now_us() - this.heard_us_) / 1000;
    if (quiet_ms >= limit_ms) {
      this.listener_.lost(this.opened_ ? 'silent' : 'unreachable', '');
      return;
    }
    this.cancel_watch_ = this.env_.timers.after(limit_ms - quiet_ms, () => this.watch());
  }
}
