// A TCP proxy in user space that delays every byte by the same time.
import { connect, createServer, type AddressInfo, type Socket } from 'node:net';
import { clean_up } from './clean_up';

/** Forwards to a port of this machine; `delay_ms` each way. Returns its own port. */
export async function start_delay_proxy(to_port: number, delay_ms: number): Promise<number> {
  const sockets = new Set<Socket>();
  const later = (from: Socket, to: Socket): void => {
    sockets.add(from);
    from.setNoDelay(true);
    from.on('data', (bytes) => setTimeout(() => void to.write(bytes), delay_ms));
    from.on('close', () => setTimeout(() => to.destroy(), delay_ms));
    from.on('error', () => to.destroy());
  };
  const server = createServer((client) => {
    const upstream = connect(to_port, '127.0.0.1');
    later(client, upstream);
    later(upstream, client);
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  clean_up(() => {
    for (const socket of sockets) socket.destroy();
    server.close();
  });
  return (server.address() as AddressInfo).port;
}
