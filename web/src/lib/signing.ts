/** A person's own signing key: made in this browser, kept in IndexedDB, and never to be exported from it. */

const DATABASE = "outcrop-keys";
const STORE = "keys";
const ED25519 = { name: "Ed25519" };

export interface OwnKey {
  id: string;
  /** The 32 raw bytes in base64. */
  public: string;
  pair: CryptoKeyPair;
}

/** Return why this page cannot sign, or "" if it can. */
export async function cannotSign(): Promise<string> {
  if (!globalThis.isSecureContext || !("subtle" in crypto)) {
    return "This page is not served by https or from this machine, so the browser does not let it keep a key. Sign with `outcrop review`.";
  }
  try {
    await crypto.subtle.generateKey(ED25519, false, ["sign", "verify"]);
    return "";
  } catch {
    return "This browser has no Ed25519. Sign with `outcrop review`.";
  }
}

export const toBase64 = (bytes: Uint8Array): string => btoa(String.fromCharCode(...bytes));

export const toHex = (bytes: Uint8Array): string => [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");

export async function sha256(bytes: Uint8Array<ArrayBuffer>): Promise<string> {
  return toHex(new Uint8Array(await crypto.subtle.digest("SHA-256", bytes)));
}

/** The bytes that are signed: what they are signed as, then the content. */
export function message(form: string, role: string, content: string): Uint8Array<ArrayBuffer> {
  return new TextEncoder().encode(`outcrop ${form} ${role}\n${content}`);
}

export async function sign(key: OwnKey, form: string, role: string, content: string): Promise<string> {
  return toBase64(new Uint8Array(await crypto.subtle.sign(ED25519, key.pair.privateKey, message(form, role, content))));
}

/** Return the key of a person in this browser; it is made on first use. */
export async function ownKey(person: string): Promise<OwnKey> {
  const database = await opened();
  try {
    let pair = await asked<CryptoKeyPair | undefined>(database.transaction(STORE).objectStore(STORE).get(person));
    if (pair === undefined) {
      const made = (await crypto.subtle.generateKey(ED25519, false, ["sign", "verify"])) as CryptoKeyPair;
      // Two pages may make one at a time: whichever is stored first is the key.
      await asked(database.transaction(STORE, "readwrite").objectStore(STORE).add(made, person)).catch(() => undefined);
      pair = await asked<CryptoKeyPair>(database.transaction(STORE).objectStore(STORE).get(person));
    }
    const raw = new Uint8Array(await crypto.subtle.exportKey("raw", pair.publicKey));
    return { id: (await sha256(raw)).slice(0, 16), public: toBase64(raw), pair };
  } finally {
    database.close();
  }
}

function opened(): Promise<IDBDatabase> {
  const request = indexedDB.open(DATABASE, 1);
  request.onupgradeneeded = () => request.result.createObjectStore(STORE);
  return asked(request);
}

function asked<T>(request: IDBRequest<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => {
      resolve(request.result);
    };
    request.onerror = (event) => {
      event.preventDefault();
      reject(request.error ?? new Error("the browser's store of keys does not answer"));
    };
  });
}
