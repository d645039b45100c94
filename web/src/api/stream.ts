/** Server-sent events: reconnecting, in order, and told apart by name. */

export interface Stream {
  close(): void;
}

/**
 * Listen to an event stream. The browser itself resumes after a lost connection with `Last-Event-ID`, so nothing
 * is missed; `onState` tells whether the connection stands.
 */
export function listen(
  url: string,
  handlers: Record<string, (data: unknown) => void>,
  onState: (open: boolean) => void = () => {},
): Stream {
  const source = new EventSource(url);
  source.onopen = () => onState(true);
  source.onerror = () => onState(false);
  for (const [name, handle] of Object.entries(handlers)) {
    source.addEventListener(name, (event) => handle(parse((event as MessageEvent<string>).data)));
  }
  return { close: () => source.close() };
}

function parse(text: string): unknown {
  try {
    return JSON.parse(text) as unknown;
  } catch {
    return null;
  }
}
