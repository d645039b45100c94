/** The one way to the server: a typed client, problems as exceptions, optimistic locks, retries that do nothing twice. */

import createClient, { type Middleware } from "openapi-fetch";
import type { paths } from "./schema";

export interface ProblemDocument {
  type?: string;
  title?: string;
  status?: number;
  detail?: string;
  errors?: { detail?: string; pointer?: string }[];
  current?: unknown;
}

/** What the server refused, in its own words (RFC 9457). */
export class ProblemError extends Error {
  constructor(
    readonly status: number,
    readonly problem: ProblemDocument,
  ) {
    super(problem.detail ?? problem.title ?? `the server answered ${status}`);
    this.name = "ProblemError";
  }

  get kind(): string {
    return this.problem.type?.split(/[/:]/).pop() ?? "";
  }

  /** Messages by field, for forms: `/value` becomes `value`. */
  get fields(): Record<string, string> {
    const found: Record<string, string> = {};
    for (const error of this.problem.errors ?? []) {
      const field = (error.pointer ?? "").replace(/^#?\/(body\/)?/, "");
      if (error.detail !== undefined) found[field] ??= error.detail;
    }
    return found;
  }
}

let csrf = "";

/** Set the token that goes with every change made with the session cookie. */
export function setCsrf(token: string): void {
  csrf = token;
}

const forms: Middleware = {
  onRequest({ request }) {
    if (request.method === "POST" && !request.headers.has("Idempotency-Key")) {
      request.headers.set("Idempotency-Key", crypto.randomUUID());
    }
    if (request.method !== "GET" && csrf !== "") request.headers.set("X-CSRF-Token", csrf);
    return request;
  },
};

export const api = createClient<paths>({ baseUrl: "/", credentials: "same-origin" });
api.use(forms);

interface Answer<T> {
  data?: T;
  error?: unknown;
  response: Response;
}

/** Return the body of an answer, or raise what the server said was wrong. */
export async function body<T>(answer: Promise<Answer<T>>): Promise<T> {
  let result: Answer<T>;
  try {
    result = await answer;
  } catch {
    throw new ProblemError(0, { title: "No connection", detail: "the server cannot be reached; trying again is safe" });
  }
  if (!result.response.ok) {
    const problem = result.error;
    throw new ProblemError(
      result.response.status,
      typeof problem === "object" && problem !== null ? (problem as ProblemDocument) : { detail: String(problem) },
    );
  }
  return result.data as T;
}

/** Send a file as the body of a POST, with word of how far it is; `fetch` cannot tell. */
export function sendFile(url: string, file: Blob, told: (share: number) => void, stop: AbortSignal): Promise<unknown> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const end = (): void => request.abort();
    const refuse = (problem: ProblemDocument): void => {
      stop.removeEventListener("abort", end);
      reject(new ProblemError(request.status, problem));
    };
    request.open("POST", url);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.setRequestHeader("Idempotency-Key", crypto.randomUUID());
    if (csrf !== "") request.setRequestHeader("X-CSRF-Token", csrf);
    request.upload.onprogress = (event) => told(event.lengthComputable ? event.loaded / event.total : 0);
    request.onload = () => {
      let answer: unknown = null;
      try {
        answer = JSON.parse(request.responseText);
      } catch {
        // What is not JSON is not a problem document.
      }
      if (request.status >= 200 && request.status < 300) {
        stop.removeEventListener("abort", end);
        resolve(answer);
      } else refuse(typeof answer === "object" && answer !== null ? answer : { detail: `the server answered ${request.status}` });
    };
    request.onerror = () => refuse({ title: "No connection", detail: "the file could not be sent; trying again is safe" });
    request.onabort = () => refuse({ title: "Stopped", detail: "the upload was stopped" });
    stop.addEventListener("abort", end);
    request.send(file);
  });
}

/** The lock of a change: the revision it was made from. */
export function ifMatch(resource: { revision: number }): { "if-match": string } {
  return { "if-match": `"${resource.revision}"` };
}

/** Follow a list to its end, page by page. */
export async function pages<T>(
  page: (cursor: string | undefined) => Promise<{ items: T[]; next_cursor?: string | null }>,
): Promise<T[]> {
  const all: T[] = [];
  let cursor: string | undefined;
  do {
    const next = await page(cursor);
    all.push(...next.items);
    cursor = next.next_cursor ?? undefined;
  } while (cursor !== undefined);
  return all;
}
