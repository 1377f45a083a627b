// Saves a scene's sidecar to the server, which takes it from authors.
const most_bytes = 1 << 20; // the server takes no more

/** Undefined when it is saved; otherwise what to tell the author. */
export async function save_sidecar(
  page_url: string,
  token: string,
  scene_id: string,
  sidecar: string,
  unreachable: string,
): Promise<string | undefined> {
  const body = new Blob([sidecar], { type: 'application/json' });
  if (body.size > most_bytes) return `${body.size} bytes are too many, ${most_bytes} fit`;
  const address = new URL(`./api/scenes/${encodeURIComponent(scene_id)}/sidecar`, page_url);
  try {
    const response = await fetch(address, {
      method: 'PUT',
      body,
      headers: { authorization: `Bearer ${token}` },
    });
    return response.ok ? undefined : refusal(response.status, await response.text());
  } catch {
    return unreachable;
  }
}

/** The server says "403: why" in its first line; what stands between may answer with a page. */
function refusal(status: number, text: string): string {
  const [line = ''] = text.split('\n');
  const prefix = `${status}: `;
  return line.startsWith(prefix) ? line.slice(prefix.length) : `status ${status}`;
}
