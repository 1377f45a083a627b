/**
 * Whether a file in `folder` threw this. In-app browsers, extensions and translators run code in the page, too, and
 * its errors are theirs.
 */
export function is_own_error(
  event: Pick<ErrorEvent, 'filename'> | Pick<PromiseRejectionEvent, 'reason'>,
  folder: string,
): boolean {
  if ('filename' in event) return event.filename.startsWith(folder);
  const { reason } = event as { reason: unknown };
  const stack = reason instanceof Error ? (reason.stack ?? '') : '';
  return /[\w+.-]+:\/\/\S+/.exec(stack)?.[0].startsWith(folder) === true;
}
