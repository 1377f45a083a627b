// The only user of WebSocket. Everything above it uses these interfaces, and tests replace them.
import { subprotocol } from '../wire/wire';

export interface SocketEvents {
  opened(): void;
  message(data: ArrayBuffer): void;
  /** Comes once, even when the connection never opened. `code`: the WebSocket close code. */
  closed(code: number, reason: string): void;
}

export interface Socket {
  send(bytes: Uint8Array): void;
  /** Bytes accepted by send() that the network has not taken yet. */
  buffered_bytes(): number;
  /** No event follows. */
  close(): void;
}

export type OpenSocket = (events: SocketEvents) => Socket;

/** WebSocket endpoint of a page: the folder that the page was loaded from. */
export function endpoint_of(page_url: string): string {
  const url = new URL('./', page_url);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  url.search = '';
  url.hash = '';
  return url.href;
}

export function open_web_socket(url: string): OpenSocket {
  return (events) => {
    const socket = new WebSocket(url, subprotocol);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => events.opened();
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) events.message(data);
    };
    socket.onclose = ({ code, reason }) => events.closed(code, reason);
    return {
      send(bytes) {
        if (socket.readyState === WebSocket.OPEN) socket.send(bytes);
      },
      buffered_bytes: () => socket.bufferedAmount,
      close() {
        socket.onopen = socket.onmessage = socket.onclose = null;
        socket.close(1000);
      },
    };
  };
}
