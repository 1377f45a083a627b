// A web site of somebody else, on this machine.
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { clean_up } from './clean_up';

export interface OtherSite {
  readonly origin: string;
  /** Paths that browsers have asked for. */
  readonly asked: string[];
}

/** Answers every request with this page. */
export async function start_other_site(html: string): Promise<OtherSite> {
  const asked: string[] = [];
  const http = createServer((request, response) => {
    asked.push(request.url ?? '');
    response.setHeader('content-type', 'text/html');
    response.end(`<!doctype html><title>other site</title>${html}`);
  });
  await new Promise<void>((resolve) => http.listen(0, '127.0.0.1', resolve));
  clean_up(() => http.close());
  return {
    origin: `http://127.0.0.1:${(http.address() as AddressInfo).port}`,
    asked,
  };
}
