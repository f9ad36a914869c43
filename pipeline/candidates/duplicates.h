// Animals that a pool holds several times: two files of the same labels, or one annotation twice.
#pragma once

#include <vector>

#include "pipeline/candidates/ingest.h"

namespace q3d::pipeline::candidates {

// Fails every candidate as `duplicate` whose picture has the bytes of an earlier candidate's and whose
// visible keypoints, or whose box if it has none, are the same to half a pixel. Candidates of different roles
// are not compared: a pool may hold an animal's own label and its pseudo label. Needs the pictures' digests.
// Samples of one picture that look like one animal labelled by two people are kept. Adds notes of both for
// each dataset.
void fail_duplicates(std::vector<Candidate>& candidates, std::vector<IngestNote>& notes);

}  // namespace q3d::pipeline::candidates
