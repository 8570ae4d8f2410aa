#pragma once

namespace pmeta_nodes {

/// Bounds what glibc keeps of freed memory, for a process through which models come and go as
/// messages. Blocks of a megabyte and more go back to the system at once; by itself glibc would
/// come to keep them all. Of smaller ones it keeps some megabytes, so that a copy of a small model
/// does not take its memory anew from the system, page by page.
void boundFreeMemory();

}  // namespace pmeta_nodes
