import "ol/ol.css";
import "./app.css";
import { mount } from "svelte";
import App from "./App.svelte";

const host = document.getElementById("app");
if (host === null) throw new Error("the page has no element #app");

export default mount(App, { target: host });
